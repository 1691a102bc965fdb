"""The dwell of each point of an instrument from distances alone: points in no known order and without names.

1. A few points that are far apart make triangles. Each triangle of dwells whose sides are as long is a candidate: it
   lays the instrument's frame over the machine's.
2. Every point then belongs to the dwell that is nearest to it. The frame is laid over once more by all of them, until
   nothing changes; points that are at no dwell come out of it.
3. The assignment with the most points counts, if no other has nearly as many points and distances nearly as right, as
   where the places are symmetrical.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from operator import attrgetter

import numpy as np
from scipy.spatial import cKDTree

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.joining.assignment import (
    CLEARLY_WORSE,
    LIMIT_SIGMAS,
    MAX_WITHOUT,
    OTHER_SHARE,
    Assignment,
    NoAssignment,
    on_one_line,
    repeat_distance_mm,
    unit_hint,
)
from compd.joining.distances import RigidMotion, distances_rms_mm, is_spread, largest_rms_mm, lay_over

# Fewest different points; fewer fit among many dwells by chance.
MIN_POINTS = 5
# Points far apart from which triangles are made: some of them may be at no dwell.
_CORNERS = 8
# Triangles that must find the dwells of nearly all points to end the search.
_WITNESSES = 2
# Most triangles of dwells tried for one of the points, those with the most similar sides first.
_CANDIDATES = 4000
_ROUNDS = 6


def assign_by_distance(
    expected_mm: FloatArray, measured_mm: FloatArray, sigma_mm: float, in_M: bool = False
) -> Assignment | NoAssignment:
    """The dwell of each point, or the reason why it is ambiguous.

    Parameters
    ----------
    expected_mm : (S, 3) places of the dwells. measured_mm : (G, 3) points, in any order.
    sigma_mm : standard uncertainty of the instrument per axis; nan where it is not known.
    in_M : the points are measured in {M}, the frame of the places: nothing is laid over, and nothing is ambiguous but
        places near each other.

    A place that was visited several times does not tell which of its visits a point belongs to: such points are
    `unclear`.
    """
    near_mm = repeat_distance_mm(sigma_mm)
    place_of = _places(expected_mm, near_mm)
    place_mm = expected_mm[np.unique(place_of, return_index=True)[1]]
    different_mm = measured_mm[np.unique(_places(measured_mm, near_mm), return_index=True)[1]]
    if not is_spread(different_mm) and len(different_mm) >= MIN_POINTS and not in_M:
        return on_one_line(measured_mm)
    few = min(len(place_mm), len(different_mm)) < MIN_POINTS
    if few and not in_M:
        return NoAssignment(
            "too few different places to tell by their distances",
            f"{len(place_mm)} of the machine, {len(different_mm)} of the instrument",
            f"{MIN_POINTS} or more that are not on one line",
        )
    if in_M:
        results = _distinct([_grown(place_mm, measured_mm, RigidMotion(np.eye(3), np.zeros(3)), near_mm, in_M)])
    else:
        results = _assignments(place_mm, measured_mm, different_mm, near_mm)
    if not results:
        if not in_M and _assignments(place_mm, -measured_mm, -different_mm, near_mm):
            return NoAssignment(
                "the points are a mirror image of the dwells", "a left-handed frame", "x, y, z of a right-handed frame"
            )
        return NoAssignment(
            "no choice of dwells has the distances between the points",
            f"{len(different_mm)} points, {len(place_mm)} places of the machine{unit_hint(place_mm, different_mm)}",
            f"points that are the dwells' to {largest_rms_mm(place_mm):.3g} mm rms",
        )
    return _decided(results, place_mm, place_of, measured_mm)


def _places(values_mm: FloatArray, near_mm: float) -> IntArray:
    """(N,) number of the place of each point, from 0 in the order in which places first come."""
    number = np.full(len(values_mm), -1, dtype=np.int64)
    tree = cKDTree(values_mm)
    for i in range(len(values_mm)):
        if number[i] < 0:
            near = np.array(tree.query_ball_point(values_mm[i], 2.0 * near_mm))
            number[near[number[near] < 0]] = number.max() + 1
    return number


def _assignments(
    place_mm: FloatArray, measured_mm: FloatArray, different_mm: FloatArray, near_mm: float
) -> list[Assignment]:
    """All assignments that grow from triangles of points, the best first."""
    results: list[Assignment] = []
    witnesses = 0
    between = np.linalg.norm(place_mm[:, None] - place_mm[None], axis=2)
    for corners in _triangles(different_mm):
        frames = _frames(corners, place_mm, between, 3.0 * largest_rms_mm(place_mm))
        own = _distinct([_grown(place_mm, measured_mm, frame, near_mm, False) for frame in frames])
        results += own
        witnesses += bool(own) and own[0].count >= len(measured_mm) - _may_lack(len(measured_mm))
        if witnesses == _WITNESSES:
            break
    return _distinct(results)


def _frames(
    corners: FloatArray, place_mm: FloatArray, between_mm: FloatArray, tolerance_mm: float
) -> list[RigidMotion]:
    """The motions that lay a triangle of points, (3, 3), over triangles of places whose sides are as long.

    between_mm : (P, P) distances between the places. tolerance_mm : by which sides may differ.
    """
    a, b, c = corners
    sides = [float(np.linalg.norm(p - q)) for p, q in ((a, b), (a, c), (b, c))]
    first, second = np.nonzero(np.abs(between_mm - sides[0]) <= tolerance_mm)
    misfit = np.maximum(np.abs(between_mm[first] - sides[1]), np.abs(between_mm[second] - sides[2]))  # (pairs, places)
    pair, third = np.nonzero(misfit <= tolerance_mm)
    best = np.argsort(misfit[pair, third], kind="stable")[:_CANDIDATES]
    triangles = zip(first[pair[best]], second[pair[best]], third[best], strict=True)
    return [lay_over(corners, place_mm[[i, j, k]]) for i, j, k in triangles]


def _triangles(point_mm: FloatArray) -> list[FloatArray]:
    """Triangles, (3, 3) each, of a few points that are far from each other, the largest first."""
    chosen = [int(np.argmax(np.linalg.norm(point_mm - point_mm.mean(axis=0), axis=1)))]
    distance = np.linalg.norm(point_mm - point_mm[chosen[0]], axis=1)
    while len(chosen) < min(_CORNERS, len(point_mm)):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(point_mm - point_mm[chosen[-1]], axis=1))
    corners = [point_mm[list(each)] for each in combinations(chosen, 3)]
    corners.sort(key=lambda points: -float(np.linalg.norm(np.cross(points[1] - points[0], points[2] - points[0]))))
    return [each for each in corners if is_spread(each)]


def _grown(
    place_mm: FloatArray, measured_mm: FloatArray, frame: RigidMotion, near_mm: float, in_M: bool
) -> Assignment | None:
    """The assignment that grows from a frame, with places in place of dwells; None where most points are at none."""
    tree, count = cKDTree(place_mm), len(measured_mm)
    limit_mm = 3.0 * largest_rms_mm(place_mm)
    nearest = np.full((count, 2), -1)
    for _ in range(_ROUNDS):
        distance_mm, now = tree.query(frame(measured_mm), k=2)
        at_place = distance_mm[:, 0] <= limit_mm
        if at_place.sum() < max(min(MIN_POINTS, count), count / 2):
            return None
        if not in_M:
            if not is_spread(place_mm[now[at_place, 0]]):
                return None
            frame = lay_over(measured_mm[at_place], place_mm[now[at_place, 0]])
        if np.array_equal(now, nearest):
            break
        nearest = now
        # the median, since some points do not belong there
        typical_mm = 1.5 * float(np.median(distance_mm[at_place, 0]))
        limit_mm = min(max(LIMIT_SIGMAS * typical_mm, near_mm), 3.0 * largest_rms_mm(place_mm))
    unclear: BoolArray = at_place & (distance_mm[:, 1] <= limit_mm)
    dwell = np.where(at_place, now[:, 0], -1).astype(np.int64)
    rms_mm = distances_rms_mm(place_mm[dwell[at_place]], measured_mm[at_place])
    return Assignment(dwell, rms_mm, limit_mm, np.where(unclear, now[:, 1], -1).astype(np.int64), unclear)


def _may_lack(points: int) -> float:
    """Most points at no dwell, by their number."""
    return max(1.0, MAX_WITHOUT * points)


def _distinct(results: Sequence[Assignment | None]) -> list[Assignment]:
    """Different assignments, those with the most points first, then those with the most similar distances."""
    different = {tuple(result.dwell.tolist()): result for result in results if result is not None}
    return sorted(different.values(), key=lambda each: (-each.count, each.rms_mm))


def _decided(
    results: list[Assignment], place_mm: FloatArray, place_of: IntArray, measured_mm: FloatArray
) -> Assignment | NoAssignment:
    """The best assignment, with dwells in place of places, if it is clearly better than all others and right."""
    may_lack = _may_lack(len(measured_mm))
    best = min((each for each in results if each.count >= results[0].count - may_lack), key=attrgetter("rms_mm"))
    with_place = best.dwell >= 0
    allowed_mm = largest_rms_mm(place_mm[best.dwell[with_place]])
    if best.rms_mm > allowed_mm:
        return NoAssignment(
            "the distances between points are farther from those of the dwells than a machine can be wrong",
            f"{best.rms_mm:.3g} mm rms",
            f"{allowed_mm:.3g} mm or less",
        )
    for rival in results:
        same = float((rival.dwell == best.dwell)[with_place].mean())
        if rival.count >= best.count - may_lack and same < OTHER_SHARE and rival.rms_mm < CLEARLY_WORSE * best.rms_mm:
            return NoAssignment(
                "two assignments fit equally well, as where the places are symmetrical",
                f"{best.rms_mm:.3g} mm rms and {rival.rms_mm:.3g} mm rms, {same:.0%} of the points at the same places",
                "one that is clearly better",
            )
    without = np.flatnonzero(~with_place)
    if len(without) > may_lack:
        return NoAssignment(
            f"{len(without)} of {len(measured_mm)} points are at no dwell",
            f"{best.rms_mm:.3g} mm rms of the others",
            f"one, or {MAX_WITHOUT:.0%}",
            int(without[0]),
        )
    visits = np.bincount(place_of)
    first_dwell = np.unique(place_of, return_index=True)[1]
    unclear = best.unclear | (with_place & (visits[best.dwell] > 1))
    dwell = np.where(with_place & ~unclear, first_dwell[best.dwell], -1).astype(np.int64)
    other = np.where(best.other >= 0, first_dwell[best.other], -1).astype(np.int64)
    if not (dwell >= 0).any():
        return NoAssignment(
            "every place was visited several times, and nothing tells at which visit each point was measured",
            f"{len(place_of)} dwells at {len(place_mm)} places",
            "places that were visited once",
        )
    return Assignment(dwell, best.rms_mm, best.limit_mm, other, unclear)
