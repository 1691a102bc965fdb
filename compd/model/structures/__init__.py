"""The structures of numbers that kernels take: rows, machines, models and what a solver works in."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
