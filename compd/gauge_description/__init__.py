"""A gauge that no driver knows: its replies captured, what they mean asked, its description written and read back."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
