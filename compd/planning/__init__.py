"""What to measure next: the rows that tell rivals apart, chosen among programmes that the machine can run."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
