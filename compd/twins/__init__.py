"""The far ends of lines, simulated: devices, what faults do to their replies, and the ports of this computer.

They are written from the standards, and share no code with the near ends.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
