"""The compute loop: from a snapshot of readings to a setpoint, at a fixed rate."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
