"""Straight ways of the tip on which every link moves in the direction that a plan wants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import linprog

from compd.arrays import FloatArray
from compd.instruments import Way
from compd.model import MachineModel
from compd.model.kernels import Reason
from compd.plan_file import SPEED_COLUMN, TIP_COLUMNS

# Travel of the slowest link before the place: an error of reversal has built up after a hand's width at most, and
# most of it after this. No way is longer than MAX_MM.
TRAVEL_MM = 10.0
MAX_MM = 60.0
# Time at constant speed before and after a place that is passed.
STEADY_S = 0.5
# For the derivative of the links' lengths.
_STEP_MM = 0.01


def plan_ways(model: MachineModel, rows: Sequence[Mapping[str, Any]]) -> tuple[Way | None, ...]:
    """The way of each row of a plan."""
    ways = TipWays(model)
    found = []
    for row in rows:
        direction = np.array([value for name, value in row.items() if name.startswith("approach_")], dtype=np.float64)
        found.append(ways.way(np.array([row[name] for name in TIP_COLUMNS]), direction, row[SPEED_COLUMN]))
    return tuple(found)


class TipWays:
    """Finds ways on one machine, at its nominal geometry; the platform keeps its attitude where it is free to."""

    def __init__(self, model: MachineModel) -> None:
        self._model = model

    def way(self, tip_M_mm: FloatArray, direction: FloatArray, speed_mm_per_s: float) -> Way | None:
        """The way to (or, with a speed, through) a place; None where no straight way is as wanted.

        direction : (n,) +1 or -1 for each link, 0 where it does not matter. speed_mm_per_s : of the fastest link.
        """
        slopes = self._slopes(tip_M_mm)
        if slopes is None or not direction.any():
            return None
        wanted = direction != 0
        # the largest share of its travel by which even the slowest link moves as wanted
        towards = np.column_stack([-(direction[:, None] * slopes)[wanted], np.ones(wanted.sum())])
        best = linprog([0, 0, 0, -1], A_ub=towards, b_ub=np.zeros(len(towards)), bounds=[(-1, 1)] * 3 + [(None, 1)])
        if not best.success or best.x[3] <= 0:
            return None
        course = best.x[:3] / np.linalg.norm(best.x[:3])
        travel = slopes @ course
        length_mm = TRAVEL_MM / np.abs(travel[wanted]).min()
        end_M_mm = None
        tip_mm_per_s = 0.0
        if speed_mm_per_s > 0:
            tip_mm_per_s = speed_mm_per_s / float(np.abs(travel).max())
            length_mm = max(length_mm, STEADY_S * tip_mm_per_s)
            end_M_mm = tip_M_mm + length_mm * course
        via_M_mm = tip_M_mm - length_mm * course
        stations = [via_M_mm, tip_M_mm] if end_M_mm is None else [via_M_mm, tip_M_mm, end_M_mm]
        if length_mm > MAX_MM or not self._as_wanted(np.array(stations), direction):
            return None
        return Way(via_M_mm, end_M_mm, tip_mm_per_s)

    def _as_wanted(self, stations_M_mm: FloatArray, direction: FloatArray) -> bool:
        """Whether the links move in the direction that is wanted from each of the places (k, 3) to the next."""
        scales_mm = self._scales_mm(stations_M_mm)
        return scales_mm is not None and bool(((np.diff(scales_mm, axis=0) * direction > 0) | (direction == 0)).all())

    def _slopes(self, tip_M_mm: FloatArray) -> FloatArray | None:
        """(m, 3) change of each scale per mm of the tip along x, y, z."""
        steps = _STEP_MM * np.eye(3)
        scales_mm = self._scales_mm(np.concatenate([tip_M_mm + steps, tip_M_mm - steps]))
        return None if scales_mm is None else np.asarray((scales_mm[:3] - scales_mm[3:]).T / (2 * _STEP_MM))

    def _scales_mm(self, tip_M_mm: FloatArray) -> FloatArray | None:
        """(k, m) scales at places (k, 3); None where one of them cannot be reached."""
        pose, scale_mm = self._model.reach(tip_M_mm)
        return None if (pose.reason != Reason.OK).any() else scale_mm
