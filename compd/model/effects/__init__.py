"""Effects and what they are computed from: observations of N rows, the basis at each port, its deltas, its needs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
