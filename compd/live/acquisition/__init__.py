"""Gauges are polled here: one thread per line, which puts readings into `Latest`."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
