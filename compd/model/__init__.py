"""The physics: kinematics, machine frame and statics of the tripod (3-SPR) and the hexapod (6-UPS).

Pure functions of arrays, after T. Oiwa's equations (1) to (9). Every function broadcasts over leading axes:
the live loop calls it with one snapshot, the workbench with N rows, and both get the same bits.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
