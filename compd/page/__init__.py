"""The page in the browser: a process of its own between one daemon and any number of browsers."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
