"""A planned measurement for the simulated machine: reads the file and checks it against the machine's limits."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from compd.columns import approach_columns
from compd.errors import CompdError, KinematicsError, Problem
from compd.plan_file import SPEED_COLUMN, TIP_COLUMNS, TURN_COLUMNS, PlanFile, PlanLine, read_plan_file
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.motion import SPEED_MM_PER_S
from compd.simulation.truth.planned_row import PlannedRow
from compd.simulation.truth.warm_up import PARTS

# Limits of heaters and coolers in a laboratory, of a climate chamber and of a loading device; pressure: the lowest and
# highest at sea level on record (WMO).
_LIMITS_BY_UNIT = {"degC": (0.0, 60.0), "hPa": (870.0, 1085.0), "pct": (0.0, 100.0), "N": (-1000.0, 1000.0)}


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
    if mechanism.tip_frame != "M":
        raise CompdError.of(
            str(path),
            "is for a tool on the platform; this one stands on the plate",
            value="plate",
            allowed="tool on: platform",
            next_step="plan by hand, and drive there",
        )
    names = holdable_quantities(mechanism.links)
    limits = {name: _LIMITS_BY_UNIT[name.rpartition("_")[2]] for name in names}
    problems: list[Problem] = []
    file = read_plan_file(path, mechanism.scales, {**limits, SPEED_COLUMN: (0.0, SPEED_MM_PER_S)}, problems)
    problems[:0] = _unmeasured(file, names, names if measured is None else measured)  # header before cells
    rows = _planned_rows(file, mechanism, names, problems)
    if problems:
        raise CompdError(problems)
    return rows


def _unmeasured(file: PlanFile, names: Collection[str], measured: Collection[str]) -> list[Problem]:
    """A problem for every held quantity that no gauge measures."""
    return [
        Problem(
            f"{file.path}:1 column {name}",
            "no gauge of this machine measures it: no recording will tell",
            value=name,
            allowed=", ".join(measured) or "nothing beside lengths",
            next_step="wire one to it in the configuration, or delete the column",
        )
        for name in file.header
        if name in names and name not in measured
    ]


def _planned_rows(
    file: PlanFile, mechanism: Mechanism, names: Collection[str], problems: list[Problem]
) -> tuple[PlannedRow, ...]:
    """The rows; a place out of reach, or with no room to come from its side, goes to `problems`."""
    rows: list[PlannedRow] = []
    points: dict[tuple[float, ...], int] = {}
    previous_s = math.inf
    for line in file.lines:
        tip_M_mm = tuple(line.values.get(name, math.nan) for name in TIP_COLUMNS)
        turn_rad = tuple(line.values.get(name, 0.0) for name in TURN_COLUMNS)
        time_s = line.values.get("time_s", math.nan)
        row = PlannedRow(
            len(rows) + 1,
            line.purpose,
            points.setdefault((*tip_M_mm, *turn_rad), len(points) + 1),
            not time_s > previous_s,
            time_s,
            _scale_mm(file, line, tip_M_mm, turn_rad, mechanism, problems),
            np.array([line.values.get(name, 0.0) for name in approach_columns(mechanism.scales)]),
            line.values.get(SPEED_COLUMN, 0.0),
            {name: line.values[name] for name in names if name in line.values},
        )
        problems += _approach_problems(file, line, row, mechanism)
        rows.append(row)
        previous_s = time_s
    return tuple(rows)


def _scale_mm(
    file: PlanFile,
    line: PlanLine,
    tip_M_mm: Sequence[float],
    turn_rad: Sequence[float],
    mechanism: Mechanism,
    problems: list[Problem],
) -> FloatArray:
    """(n,) scale values for a tip in {M} and a turn since machine zero, all parts as drawn; nan where unknown."""
    unknown = np.full(mechanism.scales, math.nan)
    if not all(map(math.isfinite, (*tip_M_mm, *turn_rad))):
        return unknown
    try:
        posture = mechanism.posture_at(np.array(tip_M_mm), np.array(turn_rad))
    except KinematicsError:
        posture = None
    scale_mm = unknown if posture is None else mechanism.scales_at(posture)
    if _within_stroke(scale_mm, mechanism):
        return scale_mm
    problems.append(
        Problem(
            f"{file.path}:{line.line} column {', '.join(TIP_COLUMNS)}",
            "this machine cannot reach the place",
            value=", ".join(f"{value:g}" for value in tip_M_mm),
            allowed=_stroke_text(mechanism),
            next_step="plan with a narrower --workspace",
        )
    )
    return unknown


def _approach_problems(file: PlanFile, line: PlanLine, row: PlannedRow, mechanism: Mechanism) -> list[Problem]:
    problems: list[Problem] = []
    where = f"{file.path}:{line.line} column approach_1 ..."
    if row.on_the_move and not row.approach.any():
        problems.append(
            Problem(
                where,
                "a row on the move needs a direction",
                value="0",
                allowed="-1 or 1 for the links that move",
                next_step=f"write it, or {SPEED_COLUMN} 0",
            )
        )
    ends = (row.turning_mm, row.end_mm)
    known = all(np.isfinite(end_mm).all() for end_mm in ends)
    if known and not all(_within_stroke(end_mm, mechanism) for end_mm in ends):
        problems.append(
            Problem(
                where,
                "there is no room to come from this side",
                value=", ".join(f"{value:g}" for value in row.approach),
                allowed=_stroke_text(mechanism),
                next_step="plan with a narrower --workspace",
            )
        )
    return problems


def _within_stroke(scale_mm: FloatArray, mechanism: Mechanism) -> bool:
    return bool(np.all(np.abs(scale_mm) <= mechanism.stroke_mm))


def _stroke_text(mechanism: Mechanism) -> str:
    return f"links within {float(mechanism.stroke_mm.min()):.0f} mm of machine zero"
