"""The main job on a simulated machine: simulation, daemon and controller side by side, as `compd demo` shows it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
