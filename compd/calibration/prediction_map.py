"""How uncertain the calibrated machine's prediction is over the workspace.

Numbers x move the tip of a pose by J x, those of the measured poses by J_0 x. Of the latter the rigid motion G_0 m that
fits best, m = G_0^+ J_0 x, is what registering an instrument takes, so that P = J - G G_0^+ J_0 is left of each number.
With all numbers free, the tolerance as prior, what is known of them is a mean x' and a covariance C. The calibrated
machine has x, in which the numbers of some blocks stay as drawn, so that its prediction errs by P (x' - x) with the
covariance P C P^T, together

    V = P (C + (x' - x) (x' - x)^T) P^T.

Attitudes are treated alike, with one turn of all as what registering takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from compd.arrays import FloatArray
from compd.calibration.calibration import PredictionMap, PredictionSlice
from compd.calibration.jacobian import pose_columns, rigid_columns
from compd.calibration.machine_fit import MachineFit
from compd.calibration.parameters import Parameters
from compd.calibration.pose_candidates import Box, even_poses, reachable, reachable_box
from compd.model import MachineModel
from compd.model.effects import Observations
from compd.rotation import compose, rotation_vector
from compd.statistics import solve_least_squares
from compd.units import UM_PER_MM

# Poses that are spread over the workspace, and their seed; twice as many change the median by 1 to 3 %.
_POSES, _SEED = 256, 2
# Places along each axis of a slice: odd, so that one is in the middle.
_GRID = 17
_NAMES = "xyzabc"


def prediction_map(model: MachineModel, fit: MachineFit) -> PredictionMap | None:
    """Of a fit's numbers; None where the tool stands on the plate, which has no places to plan."""
    if model.arrangement.on_plate:
        return None
    used = [now.use & ~out for now, out in zip(fit.now, fit.outlier, strict=True)]
    rows = [now.aligned.rows.select(np.flatnonzero(use)) for now, use in zip(fit.now, used, strict=True)]
    measured_mm = np.concatenate([one.tip_M_mm for one in rows])
    attitudes = np.concatenate([one.rotation_M_P for one in rows])
    measured_rad = rotation_vector(compose(attitudes, model.zero.rotation_M_P.T))
    stroke_mm = rows[0].constants.link_limits_mm
    box = _with(reachable_box(model, stroke_mm), np.concatenate([measured_mm, measured_rad], axis=1))
    spread = even_poses(model, box, _POSES, _SEED)
    planes = _planes(model, box)
    found = reachable(model, np.concatenate([spread, *(poses for *_, poses in planes)]), stroke_mm)
    near = _Moved(model, fit.parameters, fit.result.C, rows)
    std = near.standard_errors([found.rows])
    grid = np.full((len(spread) + sum(len(poses) for *_, poses in planes), 2), np.nan)
    grid[found.asked] = std
    here = found.asked < len(spread)
    slices, start = [], len(spread)
    for across, up, poses in planes:
        own = grid[start : start + len(poses)].reshape(_GRID, _GRID, 2)
        start += len(poses)
        slices.append(
            PredictionSlice(
                _NAMES[across],
                _NAMES[up],
                _held(model, (across, up), poses[0]),
                poses[:_GRID, across],
                poses[::_GRID, up],
                own[:, :, 0],
                own[:, :, 1],
            )
        )
    at_measured = near.standard_errors(rows)
    return PredictionMap(
        found.tip_M_mm[here],
        found.turn_rad[here],
        std[here, 0],
        std[here, 1],
        measured_mm,
        measured_rad,
        at_measured[:, 0],
        at_measured[:, 1],
        tuple(slices),
    )


class _Moved:
    """Displacements of poses by the numbers, less the motion that fits those of the measured ones."""

    def __init__(
        self, model: MachineModel, parameters: Parameters, C: FloatArray, measured: list[Observations]
    ) -> None:
        """C : (P, P) mean products of the numbers' errors, in tolerances."""
        self._model, self._parameters, self._C = model, parameters, C
        self._middle_mm = np.concatenate([one.tip_M_mm for one in measured]).mean(axis=0)
        tips, turns, motions = self._columns(measured)
        self._motion = solve_least_squares(motions.reshape(-1, 6), tips.reshape(-1, tips.shape[2]))
        self._turn = turns.mean(axis=0)

    def standard_errors(self, rows: Sequence[Observations]) -> FloatArray:
        """(N, 2) of the tip, um, and of the attitude, urad, each in space."""
        tips, turns, motions = self._columns(rows)
        both = (tips - motions @ self._motion) * UM_PER_MM, (turns - self._turn) * 1e6
        return np.asarray(np.sqrt(np.stack([np.einsum("nip,pq,niq->n", P, self._C, P) for P in both], axis=1)))

    def _columns(self, rows: Sequence[Observations]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(N, 3, P) of the tip, mm, and of the attitude, rad, per tolerance; (N, 3, 6) of the tip by a rigid motion."""
        J = np.concatenate([pose_columns(self._model, one, self._parameters) for one in rows])
        places_mm = np.concatenate([one.tip_M_mm for one in rows])
        return J[:, :3], J[:, 3:], rigid_columns(places_mm, self._middle_mm)


def _with(box: Box, poses: FloatArray) -> Box:
    """The box, as wide as poses (N, 6) need it."""
    return Box(np.minimum(box.low, poses.min(axis=0)), np.maximum(box.high, poses.max(axis=0)))


def _planes(model: MachineModel, box: Box) -> list[tuple[int, int, FloatArray]]:
    """Across, up and (_GRID^2, 6) poses of each slice, a row of the grid after the other.

    Through places, then through turns, each at the middle of the others; through both where a target fixes one place.
    """
    fixed = np.flatnonzero(model.actuators.fixed == 1)
    shown = [fixed[fixed < 3], fixed[fixed >= 3]] if (fixed < 3).sum() >= 2 else [fixed]
    middle = np.concatenate([(box.low + box.high)[:3] / 2, np.zeros(3)])
    free = model.actuators.fixed == 0
    middle[:3] = np.where(free[:3], model.zero.contact.tip_M_mm, middle[:3])
    planes = []
    for across, up in (pair for own in shown for pair in combinations(own.tolist(), 2)):
        poses = np.tile(middle, (_GRID**2, 1))
        sides = [np.linspace(box.low[k], box.high[k], _GRID) for k in (across, up)]
        poses[:, across], poses[:, up] = np.tile(sides[0], _GRID), np.repeat(sides[1], _GRID)
        planes.append((across, up, poses))
    return planes


def _held(model: MachineModel, shown: tuple[int, int], pose: FloatArray) -> str:
    fixed = [k for k in np.flatnonzero(model.actuators.fixed == 1).tolist() if k not in shown]
    places = ", ".join(f"{_NAMES[k]} {pose[k]:.0f}" for k in fixed if k < 3)
    turns = [_NAMES[k - 3] for k in fixed if k >= 3]
    none = "no turn" + (f" about {', '.join(turns)}" if len(turns) < 3 else "")
    return ", ".join([*([f"{places} mm"] if places else []), *([none] if turns else [])])
