"""Description of a gauge without a driver: capture replies, ask for their meaning, write and read back."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
