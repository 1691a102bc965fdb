"""Which rows of a table are rows of a recording, in the order of time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.statistics import doubled_rows

NO_TIME, DOUBLED = "time_s is empty", "each row was written twice"


def kept_rows(columns: Mapping[str, FloatArray]) -> tuple[IntArray, dict[str, int]]:
    """The rows of a table in the order of time; and reason -> number of the rows that are left out.

    columns : (N,) by name, `time_s` among them. A row without a time is no row. Where every row was written twice, the
    second of each two is none; where a column `point` tells rows at rest from those of motions, each kind by itself.
    """
    timed = ~np.isnan(columns["time_s"])
    kept = np.argsort(columns["time_s"], kind="stable")[: int(timed.sum())]
    others = [column[kept] for name, column in columns.items() if name != "time_s"]
    values = np.column_stack([np.zeros((len(kept), 0)), *others])
    at_rest = np.isfinite(columns["point"][kept]) if "point" in columns else np.ones(len(kept), dtype=bool)
    doubled = np.zeros(len(kept), dtype=bool)
    for kind in (at_rest, ~at_rest):
        doubled[kind] = doubled_rows(values[kind])
    return kept[~doubled], {NO_TIME: int((~timed).sum()), DOUBLED: int(doubled.sum())}
