"""How the doctor looks at the other end of a line: at a serial port, at a device of the network."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
