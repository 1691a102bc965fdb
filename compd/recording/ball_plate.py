"""A calibrated ball plate, as in the paper's figure 20: a CSV file with one row per ball."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.errors import Problem
from compd.files import write_files
from compd.tables import ProblemList, Table, read_table, rows_text, values_text

COLUMNS: Mapping[str, str] = {
    "ball": "number of the ball, each once",
    "x_mm": "calibrated x of its centre in the plate's own frame",
    "y_mm": "calibrated y",
    "z_mm": "calibrated z",
}
_COLUMNS = tuple(COLUMNS)


class BallPlate(NamedTuple):
    """A plate's calibration.

    path : the file. number : (B,) int, each once. position_mm : (B, 3) in the plate's own frame.
    """

    path: Path
    number: IntArray
    position_mm: FloatArray

    def positions_of_mm(self, ball: IntArray) -> FloatArray:
        """(N, 3) calibrated position of the balls numbered `ball` (N,); nan for -1, no ball.

        Other numbers must be the plate's.
        """
        order = np.argsort(self.number)
        index = order[np.searchsorted(self.number, ball, sorter=order).clip(max=len(order) - 1)]
        return np.where((ball >= 0)[:, None], self.position_mm[index], np.nan)


def read_plate(path: Path, problems: list[Problem]) -> BallPlate | None:
    """Read a plate's file: every cell filled, every ball once. Faults go to `problems`; None for a faulty file."""
    table_problems = ProblemList(path)
    table = read_table(path, table_problems, lambda cells: "ball" in cells or "x_mm" in cells)
    if table is not None:
        _check(table, table_problems)
    problems += table_problems.problems
    if table is None or table_problems.problems:
        return None
    number = table.columns["ball"].astype(np.int64)
    return BallPlate(path, number, np.column_stack([table.columns[name] for name in _COLUMNS[1:]]))


def write_plate(path: Path, position_mm: FloatArray) -> None:
    """Write a plate's file: balls 1 to B at `position_mm` (B, 3), to 0.1 um. Raises OSError."""
    lines = [f"{number},{x:.4f},{y:.4f},{z:.4f}" for number, (x, y, z) in enumerate(position_mm, 1)]
    write_files({path: "\n".join([",".join(_COLUMNS), *lines]) + "\n"})


def _check(table: Table, problems: ProblemList) -> None:
    """Columns, cells and numbers of a plate's file."""
    if set(table.letters) != set(_COLUMNS):
        problems.add(
            "",
            f"has the columns {', '.join(table.letters)}",
            allowed=", ".join(_COLUMNS),
            next_step="name the columns of the calibration like this; lengths in mm",
        )
        return
    if not len(table.row):
        problems.add("", "names no ball", next_step="add the calibrated places")
    for name in () if problems.problems else _COLUMNS:
        values = table.columns[name]
        wrong = np.isnan(values) | ((values != np.round(values)) & (name == "ball"))
        if wrong.any():
            what = "empty, or not a whole number" if name == "ball" else "empty"
            problems.add(
                f"{table.place(name)}, {rows_text(table.row[wrong].tolist())}", what, allowed="a value in every row"
            )
    number, count = np.unique(table.columns["ball"], return_counts=True)
    for repeated in number[count > 1]:
        problems.add(table.place("ball"), f"ball {repeated:g} comes twice", next_step="keep one")


def check_balls(table: Table, plate: BallPlate, problems: ProblemList) -> None:
    """Every ball that a recording names must be on the plate."""
    ball = table.columns["ball"]
    unknown = ~np.isnan(ball) & ~np.isin(ball, plate.number)
    if unknown.any():
        place = f"{table.place('ball')}, {rows_text(table.row[unknown].tolist())}"
        values = values_text(f"{number:g}" for number in np.unique(ball[unknown]))
        problems.add(place, "no such ball on the plate", values, f"a ball of {plate.path}")
