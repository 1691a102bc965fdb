"""Least squares, robust estimates, spectra and scatter of arrays: nothing here knows a recording or a machine."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
