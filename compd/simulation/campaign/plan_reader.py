"""Reader of planned measurements as `compd plan` writes them, checked against the machine.

CSV with a header, `.` decimal, UTF-8, one row per measurement: the tip's place in {M}, held quantities, direction of
approach of each link, speed. A time that is not later than the last row's begins a new programme.
"""

from __future__ import annotations

import csv
import difflib
import math
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from compd.errors import CompdError, KinematicsError, Problem
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.motion import SPEED_MM_PER_S
from compd.simulation.truth.planned_row import PlannedRow
from compd.simulation.truth.warm_up import PARTS
from compd.simulation.truth.workspace import STROKE_SHARE

TIP = ("tip_x_mm", "tip_y_mm", "tip_z_mm")
NEEDED = ("time_s", *TIP)
SPEED = "speed_mm_per_s"
# Ranges, by unit, that heaters and coolers, a climate chamber and a loading device can hold; pressure: the lowest and
# highest at sea level on record (WMO).
_RANGES = {"degC": (0.0, 60.0), "hPa": (870.0, 1085.0), "pct": (0.0, 100.0), "N": (-1000.0, 1000.0)}
_AGAIN = "`compd plan` writes such a file"


def holdable_quantities(links: int) -> tuple[str, ...]:
    """Names, with unit, of the quantities that the simulated machine can hold."""
    places = ("room", *(f"link_{i}" for i in range(1, links + 1)), *PARTS)
    return (
        *(f"temperature_{place}_degC" for place in places),
        "pressure_hPa",
        "humidity_pct",
        "force_x_N",
        "force_y_N",
        "force_z_N",
    )


def read_plan(path: Path, mechanism: Mechanism, measured: Collection[str] | None = None) -> tuple[PlannedRow, ...]:
    """The planned rows for this machine. measured : quantities that gauges are wired to; None: all.

    Raises CompdError with everything that is wrong with the file.
    """
    return _PlanReader(path, mechanism, measured).rows()


class _PlanReader:
    """One pass over one file that collects every problem, with line and column."""

    def __init__(self, path: Path, mechanism: Mechanism, measured: Collection[str] | None) -> None:
        self._path, self._mechanism = path, mechanism
        self._problems: list[Problem] = []
        self._approaches = tuple(f"approach_{i}" for i in range(1, mechanism.links + 1))
        self._holdable = holdable_quantities(mechanism.links)
        self._measured = self._holdable if measured is None else measured

    def rows(self) -> tuple[PlannedRow, ...]:
        header, lines = self._lines()
        self._check_header(header)
        places: dict[tuple[float, ...], int] = {}
        rows: list[PlannedRow] = []
        before_s = math.inf
        for line, cells in lines:
            values = self._numbers(line, header, cells)
            place = tuple(values.get(name, math.nan) for name in TIP)
            scale_mm = self._scale_mm(line, place)
            time_s = values.get("time_s", math.nan)
            row = PlannedRow(
                len(rows) + 1,
                dict(zip(header, cells, strict=False)).get("purpose", ""),
                places.setdefault(place, len(places) + 1),
                not time_s > before_s,
                time_s,
                scale_mm,
                np.array([values.get(name, 0.0) for name in self._approaches]),
                values.get(SPEED, 0.0),
                {name: values[name] for name in self._holdable if name in values},
            )
            self._check_way(line, row)
            rows.append(row)
            before_s = time_s
        if header and not lines:
            self._report("", "has no row", allowed="a header and at least one row", next_step=_AGAIN)
        if self._problems:
            raise CompdError(self._problems)
        return tuple(rows)

    # --- the file -------------------------------------------------------------------------------------

    def _lines(self) -> tuple[list[str], list[tuple[int, list[str]]]]:
        """The header, and every further row that is not empty, with its line number."""
        try:
            with self._path.open(encoding="utf-8-sig", newline="") as stream:
                reader = csv.reader(stream)
                lines = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader if any(cells)]
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            why = error.strerror if isinstance(error, OSError) else str(error)
            raise CompdError(Problem(where=str(self._path), what=f"cannot be read: {why}", next_step=_AGAIN)) from error
        if self._mechanism.tip_frame != "M":
            raise CompdError(
                Problem(
                    where=str(self._path),
                    what="is for a tool on the platform; this one stands on the plate",
                    value="plate",
                    allowed="tool on: platform",
                    next_step="plan by hand, and drive there",
                )
            )
        if not lines:
            raise CompdError(
                Problem(where=str(self._path), what="is empty", allowed="a header and rows", next_step=_AGAIN)
            )
        return lines[0][1], lines[1:]

    def _check_header(self, header: Sequence[str]) -> None:
        known = ("row", "purpose", *NEEDED, *self._holdable, *self._approaches, SPEED)
        for name in dict.fromkeys(header):
            if header.count(name) > 1:
                self._report(f":1 column {name}", "is there twice", next_step="delete one")
            if name in self._holdable and name not in self._measured:
                self._report(
                    f":1 column {name}",
                    "no gauge of this machine measures it: no recording will tell",
                    name,
                    ", ".join(self._measured) or "nothing beside lengths",
                    "wire one to it in the configuration, or delete the column",
                )
            if name in known:
                continue
            close = difflib.get_close_matches(name, known, n=1)
            step = f"did you mean {close[0]}?" if close else "delete the column, or plan for another pair"
            self._report(f":1 column {name}", "is nothing that this machine can be told", name, ", ".join(known), step)
        for name in NEEDED:
            if name not in header:
                self._report(f":1 column {name}", "is missing", allowed=", ".join(NEEDED), next_step=_AGAIN)

    def _numbers(self, line: int, header: Sequence[str], cells: Sequence[str]) -> dict[str, float]:
        """Values by column, nan where a cell is wrong."""
        if len(cells) != len(header):
            self._report(
                f":{line}",
                "has not as many cells as the header",
                str(len(cells)),
                str(len(header)),
                "write a number with `.`, and no comma in a purpose without quotes",
            )
        values = {}
        for name, cell in zip(header, cells, strict=False):
            if name in (*NEEDED, *self._holdable, *self._approaches, SPEED):
                values[name] = self._number(f":{line} column {name}", name, cell)
        return values

    def _number(self, place: str, name: str, cell: str) -> float:
        low, high = self._range(name)
        allowed = f"{low:g} to {high:g}" if math.isfinite(high) else "a number" if low < 0 else "0 or more"
        allowed = "-1, 0 or 1" if name in self._approaches else allowed
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self._report(place, "is no number" if cell else "is empty", cell, allowed, "write a number")
            return math.nan
        if not low <= value <= high or (name in self._approaches and value not in (-1, 0, 1)):
            what = "is faster than this machine's drives" if name == SPEED and value > high else "is out of range"
            self._report(place, what, cell, allowed, "change the row, or give `compd plan` the limit")
            return math.nan
        return value

    def _range(self, name: str) -> tuple[float, float]:
        if name in self._approaches:
            return -1.0, 1.0
        if name in ("time_s", SPEED):
            return 0.0, math.inf if name == "time_s" else SPEED_MM_PER_S
        return _RANGES.get(name.rpartition("_")[2], (-math.inf, math.inf))

    # --- the machine ----------------------------------------------------------------------------------

    def _scale_mm(self, line: int, tip: Sequence[float]) -> FloatArray:
        """(n,) scale values for a tip in {M}, attitude of machine zero, parts as drawn; nan for an invalid place."""
        nowhere = np.full(self._mechanism.links, math.nan)
        if not all(map(math.isfinite, tip)):
            return nowhere
        try:
            posture = self._mechanism.posture_at(np.array(tip), np.zeros(3))
        except KinematicsError:
            posture = None
        scale_mm = nowhere if posture is None else self._mechanism.lengths(posture) - self._mechanism.lengths0_mm
        if not self._within_stroke(scale_mm):
            self._report(
                f":{line} column {', '.join(TIP)}",
                "this machine cannot reach the place",
                ", ".join(f"{value:g}" for value in tip),
                self._stroke(),
                "plan with a narrower --workspace",
            )
            return nowhere
        return scale_mm

    def _check_way(self, line: int, row: PlannedRow) -> None:
        if row.on_the_move and not row.approach.any():
            self._report(
                f":{line} column approach_1 ...",
                "a row on the move needs a direction",
                "0",
                "-1 or 1 for the links that move",
                "write it, or speed_mm_per_s 0",
            )
        ends = [row.turning_mm, row.end_mm]
        if all(np.isfinite(end_mm).all() for end_mm in ends) and not all(map(self._within_stroke, ends)):
            self._report(
                f":{line} column approach_1 ...",
                "there is no room to come from this side",
                ", ".join(f"{value:g}" for value in row.approach),
                self._stroke(),
                "plan with a narrower --workspace",
            )

    def _within_stroke(self, scale_mm: FloatArray) -> bool:
        return bool(np.all(np.abs(scale_mm) <= STROKE_SHARE * self._mechanism.lengths0_mm))

    def _stroke(self) -> str:
        stroke_mm = STROKE_SHARE * float(self._mechanism.lengths0_mm.min())
        return f"links within {stroke_mm:.0f} mm of machine zero"

    def _report(self, place: str, what: str, value: str = "", allowed: str = "", next_step: str = "") -> None:
        self._problems.append(
            Problem(where=f"{self._path}{place}", what=what, value=value, allowed=allowed, next_step=next_step)
        )
