"""Effects written as formulas: parsed, checked and evaluated without executing any of their text."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
