"""Lines to gauges: bytes or Modbus registers over a serial port or TCP, with deadlines and named faults.

A port moves bytes (`port`); a line makes requests and replies of them (`stream`, `modbus_serial`). What kinds of line
there are, and all that differs between them, is in `kinds`, one folder for each.
"""

from compd.lines.line import Line
from compd.lines.open import open_line, open_stream

__all__ = ["Line", "open_line", "open_stream"]
