"""Fixed ends: the balls from which a ballbar measures, and the pins in which the tip rests, at places nobody knows.

A distance from the tip p to the ball at c shows the tip along u = (p - c) / |p - c|, and nothing across it::

    |p - c| = d + b

with the instrument's length d and a constant b that is 0 for a calibrated length. Of a pin the place itself is shown.

Placed twice, as a frame is registered (`registration`). First c and b are found from the model's prediction of the tip,
by Gauss-Newton without outliers. Then every fit has columns for the small changes by which that is wrong: three for
each place, one for each b. A first place that is wrong by s is linear within s^2 / 2d: 0.05 um for 0.1 mm at 100 mm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.comparison.criteria import ComparisonCriteria
from compd.errors import Problem, RecordingError
from compd.statistics import robust_regression, solve_least_squares

# Gauss-Newton on a sphere from its algebraic fit converges in three or four steps.
STEPS = 20
CONVERGED_MM = 1e-7
# Coordinates of a place.
PLACE_NUMBERS = 3
# Places whose thickness is less than this share of their width lie in a plane: both sides of it have the same
# distances within width * share, a micrometre at 100 mm.
PLANE_SHARE = 1e-4


@dataclass(frozen=True, eq=False)
class FixedEnds:
    """E fixed ends and which of them each of N rows was measured at.

    name : (E,) as the file names them.  number : (E,) their numbers in the recording, rising.
    place_mm : (E, 3) where they were found to be, in the frame of the prediction.
    added_mm : (E,) what was added to each length, the constant b.
    of_row : (N,) index of the row's end, -1 for none.
    of_lengths : whether distances were measured from them; else the tip is in them.
    absolute : whether the lengths are calibrated, so that no constant is fitted along.
    """

    name: tuple[str, ...]
    number: IntArray
    place_mm: FloatArray
    added_mm: FloatArray
    of_row: IntArray
    of_lengths: bool
    absolute: bool

    @property
    def parameters(self) -> int:
        """How many numbers are always fitted along."""
        return len(self.name) * (PLACE_NUMBERS + (self.of_lengths and not self.absolute))

    def select(self, index: IntArray | slice) -> FixedEnds:
        """The rows of this index (R,)."""
        return replace(self, of_row=self.of_row[index])

    @property
    def place_of_row_mm(self) -> FloatArray:
        """(N, 3) place of each row's end; nan where it has none."""
        return np.asarray(np.where((self.of_row >= 0)[:, None], self.place_mm[self.of_row], np.nan))

    def lengths_mm(self, tip_mm: FloatArray) -> FloatArray:
        """(N, 1) distance of the tip (N, 3) from the row's end."""
        return np.asarray(np.linalg.norm(tip_mm - self.place_of_row_mm, axis=1, keepdims=True))

    def directions(self, tip_mm: FloatArray) -> FloatArray:
        """(N, 1, 3) unit vector from the row's end to the tip (N, 3): the derivative of the distance by the tip."""
        away_mm = tip_mm - self.place_of_row_mm
        return np.asarray(away_mm / np.linalg.norm(away_mm, axis=1, keepdims=True))[:, None]

    def columns(self, tip_mm: FloatArray) -> FloatArray:
        """(N, m, Q) derivatives (mm) of what is measured less what is predicted by what is fitted along.

        m is 1 for distances, 3 for pins; Q the `parameters`: the places' shifts, then the lengths' constants.
        """
        at_end = (self.of_row[:, None] == np.arange(len(self.name))).astype(np.float64)
        by_place = -self.directions(tip_mm) if self.of_lengths else np.broadcast_to(np.eye(3), (len(at_end), 3, 3))
        m = by_place.shape[1]
        of_each = np.nan_to_num(by_place)[:, :, None, :] * at_end[:, None, :, None]
        places: FloatArray = of_each.reshape(len(at_end), m, -1)
        if not self.of_lengths or self.absolute:
            return places
        return np.concatenate([places, at_end[:, None, :]], axis=2)


def place_balls(
    tip_mm: FloatArray,
    distance_mm: FloatArray,
    end: IntArray,
    absolute: bool,
    name: Callable[[int], str],
    where: str,
    criteria: ComparisonCriteria = ComparisonCriteria(),
) -> FixedEnds:
    """The fixed balls from which distances (N,) to the predicted tip (N, 3) were measured.

    end : (N,) number of each row's ball, -1 for none.  name : of a number, for people.  where : the file, for messages.
    Raises RecordingError where a ball has fewer rows than numbers to find, or where its rows lie in a plane beside it.
    """
    known = (end >= 0) & np.isfinite(distance_mm) & np.isfinite(tip_mm).all(axis=1)
    numbers = np.unique(end[known])
    problems = [
        problem
        for number in numbers
        if (problem := _why_no_ball(tip_mm[known & (end == number)], absolute, name(int(number)), where))
    ]
    if not len(numbers):
        problems = [Problem(where, "has no row with a distance and a pose", next_step="measure some")]
    if problems:
        raise RecordingError(problems)
    places, added = [], []
    for number in numbers:
        rows = known & (end == number)
        place_mm, added_mm = _ball(tip_mm[rows], distance_mm[rows], absolute, criteria.huber_sigmas)
        if problem := _beside_plane(tip_mm[rows], place_mm, name(int(number)), where):
            problems.append(problem)
        places.append(place_mm)
        added.append(added_mm)
    if problems:
        raise RecordingError(problems)
    names = tuple(name(int(number)) for number in numbers)
    return FixedEnds(names, numbers, np.array(places), np.array(added), _indices(end, numbers), True, absolute)


def place_pins(tip_mm: FloatArray, end: IntArray, name: Callable[[int], str], where: str) -> FixedEnds:
    """The pins in which the tip was, each at the middle (median) of its rows' predicted places (N, 3).

    end, name, where : as of `place_balls`.  Raises RecordingError where no row has a pin and a pose.
    """
    known = (end >= 0) & np.isfinite(tip_mm).all(axis=1)
    numbers = np.unique(end[known])
    if not len(numbers):
        raise RecordingError.of(
            where, "has no row with a pin and a pose", next_step="name the pin of each row in `pin`"
        )
    places = np.array([np.median(tip_mm[known & (end == number)], axis=0) for number in numbers])
    names = tuple(name(int(number)) for number in numbers)
    return FixedEnds(names, numbers, places, np.zeros(len(numbers)), _indices(end, numbers), False, True)


def _indices(end: IntArray, numbers: IntArray) -> IntArray:
    """(N,) place of each row's number among the sorted `numbers`, -1 where it is none of them."""
    index = np.searchsorted(numbers, end).clip(max=len(numbers) - 1)
    return np.where(numbers[index] == end, index, -1).astype(np.int64)


def _why_no_ball(tip_mm: FloatArray, absolute: bool, name: str, where: str) -> Problem | None:
    """What is wrong with too few rows of one ball; None where nothing is."""
    parameters = PLACE_NUMBERS + (not absolute)
    if len(tip_mm) > parameters:
        return None
    return Problem(
        where,
        f"{name} has {len(tip_mm)} rows, and {parameters} numbers are fitted for it",
        allowed=f"{parameters + 1} rows or more",
        next_step="measure more places from it, or exclude its rows",
    )


def _beside_plane(tip_mm: FloatArray, place_mm: FloatArray, name: str, where: str) -> Problem | None:
    """A ball beside the plane of its rows could as well be on the other side; None for a ball that is determined."""
    middle_mm = tip_mm.mean(axis=0)
    _, sizes, axes = np.linalg.svd(tip_mm - middle_mm, full_matrices=False)
    width_mm = sizes[0] / np.sqrt(len(tip_mm))
    height_mm = abs(float(axes[2] @ (place_mm - middle_mm)))
    if sizes[2] > PLANE_SHARE * sizes[0] or height_mm <= PLANE_SHARE * width_mm:
        return None
    return Problem(
        where,
        f"all places measured from {name} lie in one plane, so that it may be on either side of it",
        value=f"{height_mm:.3g} mm beside the plane",
        allowed="places at several heights, or all in a plane through the ball",
        next_step="measure some places nearer to the ball's pole",
    )


def _ball(tip_mm: FloatArray, distance_mm: FloatArray, absolute: bool, huber: float) -> tuple[FloatArray, float]:
    """Place (3,) and constant of one ball, from the algebraic sphere on by Gauss-Newton with Huber's weights.

    Algebraic: |p|^2 - d^2 = 2 c.p + 2 b d + (b^2 - |c|^2), linear in c, b and the bracket.
    """
    middle_mm = tip_mm.mean(axis=0)
    p = tip_mm - middle_mm
    varies = bool(np.ptp(distance_mm) > PLANE_SHARE * float(np.abs(p).max())) and not absolute
    spread = [2 * (distance_mm - distance_mm.mean())[:, None]] if varies else []
    A = np.concatenate([2 * p, *spread, np.ones((len(p), 1))], axis=1)
    c = solve_least_squares(A, (p**2).sum(axis=1) - distance_mm**2)[:3]
    if absolute:
        c = _on_its_side(p, distance_mm, c)
    b = 0.0 if absolute else float(np.median(np.linalg.norm(p - c, axis=1) - distance_mm))
    for _ in range(STEPS):
        away_mm = p - c
        length_mm = np.linalg.norm(away_mm, axis=1)
        along = -away_mm / length_mm[:, None]
        G = along if absolute else np.concatenate([along, -np.ones((len(p), 1))], axis=1)
        step = robust_regression(G[:, None], (distance_mm + b - length_mm)[:, None], huber=huber)
        c = c + step[:3]
        b += 0.0 if absolute else float(step[3])
        if np.abs(step).max() < CONVERGED_MM:
            break
    return c + middle_mm, b


def _on_its_side(p: FloatArray, distance_mm: FloatArray, c: FloatArray) -> FloatArray:
    """The start moved off the plane of flat places (R, 3) where known lengths say that the ball is beside it.

    The algebraic sphere of places in a plane has its middle in it, and no step leaves it.
    """
    _, sizes, axes = np.linalg.svd(p, full_matrices=False)
    if sizes[2] > PLANE_SHARE * sizes[0]:
        return c
    beside_mm2 = float(np.median(distance_mm**2 - ((p - c) ** 2).sum(axis=1)))
    beside = beside_mm2 > (PLANE_SHARE * float(sizes[0])) ** 2
    return np.asarray(c + axes[2] * np.sqrt(beside_mm2)) if beside else c
