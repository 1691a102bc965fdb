"""Memory that the daemon's processes share: made before they are forked, written by one of them, read by the others."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
