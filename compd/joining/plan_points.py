"""The dwell of each row of a plan, by the plan's places and order."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.errors import RecordingError
from compd.joining.distances import MAX_RMS_MM
from compd.joining.monotone_match import CLEAR_MARGIN, match_in_order
from compd.plan_file import TIP_COLUMNS, WRITTEN_BY
from compd.tables import ProblemList, read_table


def read_plan_points(path: Path) -> FloatArray:
    """(K, 3) places of a plan's rows in {M}, mm. Raises RecordingError for an unreadable plan."""
    problems = ProblemList(path)
    table = read_table(path, problems, lambda cells: "time_s" in cells, ("purpose",))
    if table is None:
        raise RecordingError(problems.problems)
    missing = [name for name in TIP_COLUMNS if name not in table.columns]
    if missing:
        problems.refuse("", f"has no column {', '.join(missing)}", allowed=", ".join(TIP_COLUMNS), next_step=WRITTEN_BY)
    places_mm = np.column_stack([table.columns[name] for name in TIP_COLUMNS])
    if problems.problems or not len(places_mm) or not np.isfinite(places_mm).all():
        problems.refuse("", "has rows without a place for the tip", next_step=WRITTEN_BY)
    return places_mm


def dwell_of_plan_rows(expected_mm: FloatArray, plan_mm: FloatArray, path: Path) -> IntArray:
    """(K,) number of the dwell, from 0, of each row of a plan; -1 where ambiguous.

    expected_mm : (S, 3) places of the dwells in {M}, in the order of time. plan_mm : (K, 3) of the plan's rows, in the
        order of measuring; rows at one place, such as those with different loads, may share a dwell.
    A dwell may be MAX_RMS_MM from the plan's place, no more. Raises RecordingError if none is at any place.
    """
    residual_mm = np.linalg.norm(expected_mm[:, None, :] - plan_mm[None, :, :], axis=2)
    match = match_in_order(residual_mm, MAX_RMS_MM)
    clear = (match.dwell >= 0) & (match.margin >= CLEAR_MARGIN)
    if not clear.any():
        raise RecordingError.of(
            str(path),
            "the machine dwelled at no place of the plan, in its order",
            value=f"nearest {np.nanmin(residual_mm):.3g} mm" if np.isfinite(residual_mm).any() else "",
            allowed=f"{MAX_RMS_MM:g} mm",
            next_step="give the plan that was measured, or join --by order",
        )
    return np.where(clear, match.dwell, -1).astype(np.int64)
