"""Putting a recording of gauges and an instrument's export together, by time, order, name or distance."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
