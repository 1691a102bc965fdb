"""The machine as built: numbers that a calibration has found, in files that machines and people read."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
