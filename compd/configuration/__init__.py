"""The machine configuration: written by a person, checked as a whole, never rewritten by the program."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
