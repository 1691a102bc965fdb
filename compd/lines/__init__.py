"""Lines to gauges: bytes or Modbus registers over a serial port or TCP, with deadlines and named faults.

A port moves bytes (`port`); a line makes requests and replies of them (`stream`, `modbus_serial`). What kinds of line
there are, and all that differs between them, is in `kinds`, one folder for each.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
