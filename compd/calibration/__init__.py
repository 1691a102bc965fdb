"""Calibration: from the drawing of a machine and measured poses to the machine as built.

The numbers of the drawing are the library's geometric effects, in blocks (`parameters`). How measured poses change with
them, and which combinations these cannot tell, say `jacobian` and `identifiability`. `calibration` is the result.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
