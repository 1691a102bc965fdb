"""Suffixes of a plan's files by format."""

from __future__ import annotations

# Names as in the guide on planned measurements.
ENDINGS = {"plan": "plan.csv", "sa": "targets.txt", "csv": "targets.csv", "gcode": "plan.ngc"}
