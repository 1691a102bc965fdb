"""The reflectors of a recording: which of them a row shows, and where it is on the platform."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from compd.arrays import FloatArray
from compd.tables import ProblemList, Table

COLUMN = "reflector"


def check_reflectors(table: Table, places_mm: Mapping[str, tuple[float, float, float]], problems: ProblemList) -> None:
    """Add a problem for every name in the column that the sidecar gives no place. The layout reports a missing column.

    places_mm : by name, from the tip along the axes of {P}.
    """
    if COLUMN not in table.columns:
        return
    if unknown := sorted(set(_names(table)) - {"", *places_mm}):
        problems.add(
            "",
            f"{COLUMN}: the sidecar gives no place of it",
            ", ".join(unknown[:5]),
            ", ".join(places_mm),
            "mend the name, or add its place to `reference.reflectors`",
        )


def reflector_places_mm(table: Table, places_mm: Mapping[str, tuple[float, float, float]]) -> FloatArray:
    """(N, 3) place of each row's reflector, from the tip along the axes of {P}; nan where the cell is empty.

    places_mm : as of `check_reflectors`, which the table has passed.
    """
    unknown = (np.nan, np.nan, np.nan)
    return np.array([places_mm.get(name, unknown) for name in _names(table)], dtype=np.float64).reshape(-1, 3)


def _names(table: Table) -> list[str]:
    """The reflector of each row as the sidecar names it, "" for an empty cell."""
    labels = table.labels.get(COLUMN)
    ids = [None if np.isnan(value) else int(value) for value in table.columns[COLUMN]]
    return ["" if i is None else labels[i] if labels else str(i) for i in ids]
