"""Text for people and programs: numbers with units, lines of a fixed number, JSON, bytes with escapes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
