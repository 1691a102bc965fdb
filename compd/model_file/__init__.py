"""The model file: effects with their fitted parameters, as a document and as what the daemon and the workbench load."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
