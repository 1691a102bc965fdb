"""Lines to gauges: bytes or Modbus registers over a serial port or TCP, with deadlines and named faults.

A port moves bytes (`port`); a line makes requests and replies of them (`stream`, `modbus_rtu`, `modbus_tcp`).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
