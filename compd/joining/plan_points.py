"""Which row of a plan each dwell of a recording is: by where the plan sends the tip, in the plan's order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from compd.errors import Problem, RecordingError
from compd.joining.distances import LARGEST_RMS_MM
from compd.joining.dwells import Dwell
from compd.joining.monotone_match import CLEAR_MARGIN, match_in_order
from compd.recording.csv_table import read_table
from compd.recording.plan_file import TIP_COLUMNS, WRITTEN_BY
from compd.recording.problem_list import ProblemList


def read_plan_points(path: Path) -> FloatArray:
    """(K, 3) where the rows of a plan send the tip, in {M}, mm. Raises RecordingError where it cannot be read."""
    problems = ProblemList(path)
    table = read_table(path, problems, lambda cells: "time_s" in cells, ("purpose",))
    if table is None:
        raise RecordingError(problems.problems)
    missing = [name for name in TIP_COLUMNS if name not in table.columns]
    if missing:
        problems.add("", f"has no column {', '.join(missing)}", allowed=", ".join(TIP_COLUMNS), next_step=WRITTEN_BY)
        raise RecordingError(problems.problems)
    places_mm = np.column_stack([table.columns[name] for name in TIP_COLUMNS])
    if problems.problems or not len(places_mm) or not np.isfinite(places_mm).all():
        problems.add("", "has rows without a place for the tip", next_step=WRITTEN_BY)
        raise RecordingError(problems.problems)
    return places_mm


def dwells_of_plan(
    dwells: Sequence[Dwell], expected_mm: FloatArray, plan_mm: FloatArray, path: Path
) -> tuple[Dwell, ...]:
    """The dwells, each with the number of its row in the plan (from 1) as its point; other dwells without one.

    expected_mm : (S, 3) places of the dwells in {M}. plan_mm : (K, 3) of the plan's rows, in the order of measuring.
    A dwell may be LARGEST_RMS_MM from the plan's place, no more. Raises RecordingError where none is at any place.
    """
    residual_mm = np.linalg.norm(plan_mm[:, None, :] - expected_mm[None, :, :], axis=2)
    match = match_in_order(residual_mm, LARGEST_RMS_MM)
    clear = (match.dwell >= 0) & (match.margin >= CLEAR_MARGIN)
    if not clear.any():
        raise RecordingError(
            Problem(
                where=str(path),
                what="the machine dwelled at no place of the plan, in its order",
                value=f"nearest {np.nanmin(residual_mm):.3g} mm" if np.isfinite(residual_mm).any() else "",
                allowed=f"{LARGEST_RMS_MM:g} mm",
                next_step="give the plan that was measured, or join --by order",
            )
        )
    rows = np.where(clear, match.dwell + 1, 0)
    return tuple(
        replace(dwell, point=str(row) if row else "") for dwell, row in zip(dwells, rows.tolist(), strict=True)
    )
