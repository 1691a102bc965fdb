"""Names of points away from their dwell, and lines and names as listed in a message."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compd.arrays import IntArray
from compd.errors import Problem
from compd.instruments import InstrumentExport
from compd.joining.by_name import NameCheck
from compd.joining.dwells import Dwell

# Most names and lines listed in a message.
_SHOWN = 8


def name_problems(
    check: NameCheck, dwells: Sequence[Dwell], export: InstrumentExport, dwell: IntArray
) -> list[Problem]:
    """Every name away from its point; two swapped names form one problem."""
    assert export.name is not None
    if check.why or not len(check.wrong):
        return [
            Problem(
                str(export.path),
                check.why
                or "the distances between points are farther from those of the dwells than a machine can be wrong",
                value=f"{check.rms_mm:.3g} mm rms" if np.isfinite(check.rms_mm) else "",
                allowed=f"{check.allowed_mm:.3g} mm or less"
                if np.isfinite(check.allowed_mm)
                else "three places or more",
                next_step="check names, unit and machine; join --by order; or measure in {M}, and say --frame machine",
            )
        ]
    problems = []
    for point, nearest, off_mm in zip(check.wrong, check.nearest, check.off_mm, strict=True):
        name, own = export.name[point], dwells[dwell[point]].point
        there = dwells[nearest].point or f"dwell {dwells[nearest].number}" if nearest >= 0 else ""
        swapped = [
            export.name[other]
            for other in check.wrong
            if other != point
            and nearest >= 0
            and dwells[dwell[other]].point == dwells[nearest].point
            and dwells[check.nearest[list(check.wrong).index(other)]].point == own
        ]
        elsewhere = f"; it is where {there} is" if there else "; it is at no dwell's place"
        elsewhere += f": {name} and {swapped[0]} are swapped" if swapped else ""
        problems.append(
            Problem(
                f"{export.path}:{export.line[point]}",
                f"{name} is {off_mm:.3g} mm from where point {own} was{elsewhere}",
                next_step="mend the names in the export, or delete the line",
            )
        )
    return problems


def lines_text(export: InstrumentExport, points: IntArray) -> str:
    """The lines of these points in the export: "lines 5, 9"."""
    return f"line{'s' * (len(points) != 1)} " + listed([str(export.line[j]) for j in points])


def listed(texts: Sequence[str]) -> str:
    """The first few, each once."""
    different = list(dict.fromkeys(texts))
    more = len(different) - _SHOWN
    return ", ".join(different[:_SHOWN]) + (f" and {more} more" if more > 0 else "")
