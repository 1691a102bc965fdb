"""The machine as it is wired: what each channel measures, its zero, the models for it, and reasons in words."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
