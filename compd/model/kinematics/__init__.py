"""Kinematics, machine frame, statics and tool of the tripod (3-SPR) and the hexapod (6-UPS)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
