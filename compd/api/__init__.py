"""The public functions that put several rooms together: what `import compd` and the commands offer."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
