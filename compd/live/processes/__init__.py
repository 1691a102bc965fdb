"""The daemon's processes: the supervisor that forks and watches them, what each does, and what they tell each other."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
