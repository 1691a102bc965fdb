"""Gauges as a person handles them: which drivers there are, one gauge opened, found, read and described in a file."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
