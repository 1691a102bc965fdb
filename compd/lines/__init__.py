"""Lines: bytes or registers over a serial port or TCP, with deadlines and named faults."""

from compd.lines.open import Line, open_line

__all__ = ["Line", "open_line"]
