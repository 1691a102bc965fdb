"""Every driver against every fault that a wire can have: `compd gauge test-driver`."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
