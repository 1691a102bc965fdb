"""The equations of both modes with effects: from gauge values to corrections, one row or many."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
