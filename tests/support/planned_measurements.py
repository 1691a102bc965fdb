"""Plans of measurements for tests: their files, and the poor recordings that make a plan necessary."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

# Rows without a load that a poor recording keeps.
UNLOADED = 60
HEAD = ("row", "purpose", "time_s", "tip_x_mm", "tip_y_mm", "tip_z_mm")
TAIL = ("approach_1", "approach_2", "approach_3", "speed_mm_per_s")


def plan_file(path: Path, rows: Sequence[Mapping[str, object]], quantities: Sequence[str] = ()) -> Path:
    """A plan as `compd plan --out` writes it; what a row leaves out is that of a tripod at rest at its machine zero."""
    at_rest = dict.fromkeys((*quantities, *TAIL), 0)
    usual = at_rest | {"purpose": "a test", "time_s": 0.0, "tip_x_mm": 0.0, "tip_y_mm": 0.0, "tip_z_mm": 190.0}
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, [*HEAD, *quantities, *TAIL], lineterminator="\n")
        writer.writeheader()
        for number, row in enumerate(rows, start=1):
            writer.writerow({"row": number, **usual, **row})
    return path


def thin(path: Path, out: Path, keep: Callable[[Mapping[str, str]], bool]) -> None:
    """Copy about UNLOADED of a recording's rows without a load, and the rows with a load for which `keep` is true."""
    with path.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    is_loaded = [any(float(row[f"force_{axis}_N"]) for axis in "xyz") for row in rows]
    every = (len(rows) - sum(is_loaded)) // UNLOADED
    unloaded = [k for k, loaded in enumerate(is_loaded) if not loaded][::every]
    kept = sorted([*unloaded, *(k for k, loaded in enumerate(is_loaded) if loaded and keep(rows[k]))])
    with out.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[k] for k in kept)
    shutil.copy(path.with_suffix(".yaml"), out.with_suffix(".yaml"))


def straight_down(row: Mapping[str, str]) -> bool:
    """Loads of about one size and direction: a straight line and a curve are the same there."""
    x, y, z = (float(row[f"force_{axis}_N"]) for axis in "xyz")
    return abs(x) < 12.0 and abs(y) < 12.0 and -60.0 < z < -25.0
