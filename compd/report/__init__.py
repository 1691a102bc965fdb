"""Pages that work offline: comparison, diagnosis, effect and ledger, all from one template (`page`)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
