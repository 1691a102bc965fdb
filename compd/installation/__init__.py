"""The daemon and its page as services of systemd: installed, replaced by another release, and back."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
