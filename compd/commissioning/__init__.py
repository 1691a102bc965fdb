"""From a plug to a number: find a gauge, describe it, watch it, and plan what its line can carry."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
