"""How the files of a plan end, by their format."""

from __future__ import annotations

# As the guide on planned measurements calls them.
ENDINGS = {"plan": "plan.csv", "sa": "targets.txt", "csv": "targets.csv", "gcode": "plan.ngc"}
