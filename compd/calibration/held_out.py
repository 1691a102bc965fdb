"""Errors of poses that a fit has not seen: random ones, and whole regions of the workspace.

Random poses tell whether numbers are noise. Poses of a region that was left out tell whether numbers hold elsewhere:
gains that follow from one height fit that height.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.calibration.criteria import CalibrationCriteria
from compd.calibration.jacobian import without
from compd.calibration.machine_fit import MachineFit
from compd.calibration.prior_fit import Whitened, fit_with_prior, normal_equations, open_columns, registration_of
from compd.recording import Recording

# Parts into which rows are dealt at random, and how often.
PARTS, _DEALS = 5, 2
_SEED = 40
# Rows that a calibration needs: each part is predicted from the others, and has two.
FEWEST_ROWS = 2 * PARTS
# Rows beyond the registration's numbers that a recording needs among those learned from.
_SPARE_VALUES = 6


class Fold(NamedTuple):
    """Rows left out together, of each recording (N,)."""

    regions: bool
    left_out: tuple[BoolArray, ...]


class HeldOut(NamedTuple):
    """Mean squares per measured value, in variances of the noise: of random poses, and of regions."""

    random: float
    regions: float

    @property
    def score(self) -> float:
        """Sum of the logarithms: each halving counts alike."""
        return float(np.log(self.random) + np.log(self.regions))


def folds(fit: MachineFit) -> list[Fold]:
    """Random parts, the repeats of a visit and the reflectors of a pose together; and the lowest and the highest third
    along each direction in which the poses spread."""
    rng = np.random.default_rng(_SEED)
    result = []
    for _ in range(_DEALS):
        part = [_dealt(rng, _together(now.aligned.recording), len(now.use)) for now in fit.now]
        result += [Fold(False, tuple(own == k for own in part)) for k in range(PARTS)]
    places_mm = [now.aligned.rows.tip_M_mm for now in fit.now]
    used_mm = np.concatenate([place[now.use] for place, now in zip(places_mm, fit.now, strict=True)])
    middle_mm, directions, spread_mm = principal_directions(used_mm)
    for k in range(3):
        if spread_mm[k] < CalibrationCriteria.thin_share * spread_mm[0]:
            continue
        low, high = np.quantile((used_mm - middle_mm) @ directions[k], [1 / 3, 2 / 3])
        along = [(place - middle_mm) @ directions[k] for place in places_mm]
        result.append(Fold(True, tuple(own < low for own in along)))
        result.append(Fold(True, tuple(own > high for own in along)))
    return result


def principal_directions(places_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Middle (3,), directions (3, 3) as rows and standard deviations (3,) along them, the largest first."""
    middle_mm = places_mm.mean(axis=0)
    _, sizes, directions = np.linalg.svd(places_mm - middle_mm, full_matrices=False)
    spread = np.zeros(3)
    spread[: len(sizes)] = sizes / np.sqrt(max(len(places_mm), 1))
    return middle_mm, directions, spread


def held_out(fit: MachineFit, free: BoolArray, parts: Sequence[Fold]) -> HeldOut:
    """Mean squares of what the numbers `free` (P,) leave of rows that are left out."""
    total = {True: [0.0, 0], False: [0.0, 0]}
    for fold in parts:
        for left in left_of(fit, free, fold):
            total[fold.regions][0] += float((left**2).sum())
            total[fold.regions][1] += len(left)
    random, regions = (values[0] / values[1] if values[1] else 1.0 for values in (total[False], total[True]))
    return HeldOut(random, regions)


def left_of(fit: MachineFit, free: BoolArray, fold: Fold) -> list[FloatArray]:
    """What is left of the rows that a fold leaves out, in standard deviations of the noise, of each recording."""
    learned = [part.of_rows(~left) for part, left in zip(fit.linear, fold.left_out, strict=True)]
    unseen = [part.of_rows(left) for part, left in zip(fit.linear, fold.left_out, strict=True)]
    x = fit_with_prior(normal_equations(learned), fit.parameters.block_of, free).x
    left = []
    for known, tested in zip(learned, unseen, strict=True):
        # a recording of which nothing else is left is registered by itself
        by: Whitened = known if len(known.z) >= known.R.shape[1] + _SPARE_VALUES else tested
        own = tested.z - tested.J @ x - tested.R @ registration_of(by, x)
        left.append(without(own[:, None], open_columns(by.R, tested.R))[:, 0])
    return left


def _together(recording: Recording) -> IntArray | None:
    """(N,) number of what is left out as a whole, -1 for a row by itself; None where every row is.

    These are visits; of several reflectors poses, by the point of a row, or by equal positions of the machine.
    """
    if recording.target_P_mm is None or recording.motion_mm is None:
        return recording.visit
    if recording.point is not None:
        return recording.point
    return np.asarray(np.unique(recording.motion_mm, axis=0, return_inverse=True)[1].ravel())


def _dealt(rng: np.random.Generator, together: IntArray | None, rows: int) -> IntArray:
    """(N,) number of the random part of each row, alike for rows that are left out together."""
    own = rng.permutation(rows) % PARTS
    if together is None:
        return np.asarray(own)
    names, place = np.unique(together, return_inverse=True)
    of_each = rng.permutation(len(names)) % PARTS
    return np.asarray(np.where(together >= 0, of_each[place], own))
