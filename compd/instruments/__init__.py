"""What instruments write: reading their exports, and writing plans and samples in the same shapes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
