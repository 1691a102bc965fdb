"""Lines to gauges: bytes or Modbus registers over a serial port or TCP, with deadlines and named faults.

A port moves bytes (`port`); a line makes requests and replies of them (`stream`, `modbus_rtu`, `modbus_tcp`).
"""

from compd.lines.open import Line, open_line, open_stream

__all__ = ["Line", "open_line", "open_stream"]
