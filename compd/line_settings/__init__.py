"""What a line is set to, whatever its kind: its pace, its serial port, what starts a round of all its gauges."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
