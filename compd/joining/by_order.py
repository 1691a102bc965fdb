"""The dwell of each point of an instrument, from the order in which both were measured and from distances alone.

1. Starts. Places of the machine, and points of the instrument, that follow each other at one place count once. A window
   of the instrument's points is compared with every window of as many places: by the distances between its points, all
   with all. The best window of each shift (instrument's point k is the machine's place k + shift) is a start.
2. From each start the instrument's frame is laid over the machine's, all points are matched with the dwells in order
   (`monotone_match`), and both are repeated until nothing changes. Dwells without a point, points that fit no dwell,
   and several points at one dwell come out of it.
3. The assignment with the most points counts, if no other has nearly as many points and distances nearly as right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from compd.arrays import FloatArray, IntArray
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
from compd.joining.distances import distances_rms_mm, is_spread, largest_rms_mm, lay_over, separation_mm
from compd.joining.monotone_match import CLEAR_MARGIN, match_in_order

# Points of one window: 28, 10 or 6 distances. Shorter ones are tried where gaps leave no longer part without one.
_WINDOWS = (8, 5, 4)
# Starts to try; repeats of one motion make as many equally good ones as there are cycles.
_STARTS = 12
_ROUNDS = 6
# Least share of the points with a dwell after a shift, for a comparison.
_MOST = 0.75


def assign_by_order(expected_mm: FloatArray, measured_mm: FloatArray, sigma_mm: float) -> Assignment | NoAssignment:
    """The dwell of each point, or the reason why it is ambiguous.

    expected_mm : (S, d) places of the dwells, in the order of time. measured_mm : (G, d) points in theirs.
    sigma_mm : standard uncertainty of the instrument per axis; nan where it is not known.
    """
    repeat_mm = repeat_distance_mm(sigma_mm)
    stop, place = _collapsed(expected_mm, repeat_mm)
    group, point = _collapsed(measured_mm, repeat_mm)
    most = min(len(place), len(point))
    if most < 3 or not is_spread(place):
        return NoAssignment(
            "too few different places to tell by their distances",
            f"{len(place)} of the machine, {len(point)} of the instrument",
            "three or more that are not on one line",
        )
    if not is_spread(point):
        return on_one_line(measured_mm)
    refusals = []
    for window in sorted({min(window, most) for window in _WINDOWS}, reverse=True):
        starts = _starts(place, point, window)
        grown = [_grown(expected_mm, measured_mm, int(stop[i]), int(group[j]), window, repeat_mm) for _, i, j in starts]
        assignments = [assignment for assignment in grown if assignment is not None]
        result = _decided(assignments, expected_mm, measured_mm) if assignments else None
        if isinstance(result, Assignment) or (result is not None and result.point is None):
            return result
        mirrored = measured_mm.shape[1] == 3 and any(
            _grown(expected_mm, -measured_mm, int(stop[i]), int(group[j]), window, repeat_mm) for _, i, j in starts
        )
        if not assignments and mirrored:
            return NoAssignment(
                "the points are a mirror image of the dwells", "a left-handed frame", "x, y, z of a right-handed frame"
            )
        rms_mm, i, j = starts[0]
        allowed_mm = largest_rms_mm(place[i : i + window])
        best = f"{window} points in succession differ by {rms_mm:.3g} mm rms at best{unit_hint(place, point)}"
        what = "no order of the dwells has the distances between the points"
        refusals.append(result or NoAssignment(what, best, f"{allowed_mm:.3g} mm or less", int(group[j]), int(stop[i])))
    return refusals[0]


def _collapsed(places_mm: FloatArray, near_mm: float) -> tuple[IntArray, FloatArray]:
    """First number (R,) and place (R, d) of each run of successive places near the first of the run."""
    first = [0]
    for number in range(1, len(places_mm)):
        if abs(float(separation_mm(places_mm[first[-1]], places_mm[number]))) > near_mm:
            first.append(number)
    return np.array(first, dtype=np.int64), places_mm[first]


def _starts(place: FloatArray, point: FloatArray, window: int) -> list[tuple[float, int, int]]:
    """(rms of the distances, first place, first point) of the best window of each shift, the best _STARTS of them."""
    first, second = np.triu_indices(window, 1)
    at = np.arange(len(place) - window + 1)
    of_places = separation_mm(place[at[:, None] + first], place[at[:, None] + second])
    best: dict[int, tuple[float, int, int]] = {}
    step = max(1, window // 2)
    last = len(point) - window
    for j in sorted({*range(0, last + 1, step), last}):
        of_points = separation_mm(point[j + first], point[j + second])
        rms_mm = np.sqrt(np.mean((of_places - of_points) ** 2, axis=1))
        for i, value in enumerate(rms_mm):
            if value < best.get(i - j, (np.inf, 0, 0))[0]:
                best[i - j] = (float(value), i, j)
    return sorted(best.values())[:_STARTS]


def _grown(
    expected_mm: FloatArray, measured_mm: FloatArray, first_dwell: int, first_point: int, window: int, near_mm: float
) -> Assignment | None:
    """The assignment that grows from a window that begins with this dwell and this point; None without a frame."""
    _, stops = _collapsed(expected_mm[first_dwell:], near_mm)
    _, groups = _collapsed(measured_mm[first_point:], near_mm)
    q, p = groups[:window], stops[:window]
    if not is_spread(p) or distances_rms_mm(p, q) > largest_rms_mm(p):
        return None
    dwell = np.full(len(measured_mm), -2)
    limit_mm = max(LIMIT_SIGMAS * distances_rms_mm(p, q), 4.0 * near_mm)
    for _ in range(_ROUNDS):
        motion = lay_over(q, p)
        residual_mm = np.linalg.norm(expected_mm[:, None, :] - motion(measured_mm)[None, :, :], axis=2)
        match = match_in_order(residual_mm, limit_mm)
        if np.array_equal(match.dwell, dwell):
            break
        dwell = match.dwell
        points = np.flatnonzero(dwell >= 0)
        q, p = measured_mm[points], expected_mm[dwell[points]]
        if not is_spread(p):
            return None
        # the median, since some points do not belong there
        typical_mm = float(np.median(residual_mm[dwell[points], points])) * 1.5
        limit_mm = max(LIMIT_SIGMAS * typical_mm, near_mm)
    unclear = (dwell >= 0) & (match.margin < CLEAR_MARGIN)
    points = np.flatnonzero(dwell >= 0)
    if not is_spread(expected_mm[dwell[points]]):
        return None
    return Assignment(
        dwell, distances_rms_mm(expected_mm[dwell[points]], measured_mm[points]), limit_mm, match.other, unclear
    )


def _decided(
    assignments: list[Assignment], expected_mm: FloatArray, measured_mm: FloatArray
) -> Assignment | NoAssignment:
    """The best assignment, if it is clearly better than all others and right."""
    different = {tuple(assignment.dwell.tolist()): assignment for assignment in assignments}
    ordered = sorted(different.values(), key=lambda each: (-each.count, each.rms_mm))
    best = ordered[0]
    points = np.flatnonzero(best.dwell >= 0)
    allowed_mm = largest_rms_mm(expected_mm[best.dwell[points]])
    if best.rms_mm > allowed_mm:
        return NoAssignment(
            "the distances between points are farther from those of the dwells than a machine can be wrong",
            f"{best.rms_mm:.3g} mm rms",
            f"{allowed_mm:.3g} mm or less",
        )
    may_lack = max(1.0, MAX_WITHOUT * len(best.dwell))
    rivals = [
        each
        for each in ordered[1:]
        if each.count >= best.count - may_lack and (each.dwell == best.dwell)[points].mean() < OTHER_SHARE
    ]
    if best.unclear.sum() > may_lack:
        rivals.append(_with_other_dwells(best, expected_mm, measured_mm))
    for rival in rivals:
        if rival.rms_mm < CLEARLY_WORSE * best.rms_mm:
            return NoAssignment(
                "two assignments fit equally well, as when one motion is repeated",
                f"from dwell {_first(best)} ({best.rms_mm:.3g} mm rms) and from dwell {_first(rival)} "
                f"({rival.rms_mm:.3g} mm rms)",
                "one that is clearly better",
            )
    without = _without_dwell(best, len(expected_mm), may_lack)
    best = replace(best, dwell=np.where(best.unclear, -1, best.dwell))
    if not is_spread(expected_mm[best.dwell[best.dwell >= 0]]):
        return NoAssignment("too few points have a clear dwell", str(best.count), "three or more, not on one line")
    if len(without) > may_lack:
        first = int(without[0])
        before = best.dwell[:first][best.dwell[:first] >= 0]
        return NoAssignment(
            f"{len(without)} of {len(best.dwell)} points fit no dwell in order",
            f"{best.rms_mm:.3g} mm rms of the others",
            f"one, or {MAX_WITHOUT:.0%}",
            first,
            int(before[-1]) + 1 if len(before) else 0,
        )
    return replace(best, next_best=_next_best(best, expected_mm, measured_mm))


def _with_other_dwells(best: Assignment, expected_mm: FloatArray, measured_mm: FloatArray) -> Assignment:
    """The assignment with the next best dwell of each point whose dwell is not clear."""
    dwell = np.where(best.unclear, best.other, best.dwell)
    points = np.flatnonzero(dwell >= 0)
    return replace(best, dwell=dwell, rms_mm=distances_rms_mm(expected_mm[dwell[points]], measured_mm[points]))


def _without_dwell(best: Assignment, dwells: int, may_lack: float) -> IntArray:
    """Points that have no dwell or no clear one, without those before and after the recording.

    These precede or follow points that have the first or the last dwells.
    """
    points = np.flatnonzero(best.dwell >= 0)
    first, last = int(points[0]), int(points[-1])
    without = (best.dwell < 0) | best.unclear
    if best.dwell[first] < 1 + may_lack:
        without[:first] = False
    if best.dwell[last] >= dwells - 1 - may_lack:
        without[last + 1 :] = False
    return np.flatnonzero(without)


def _first(assignment: Assignment) -> int:
    """Number, from 1, of the first dwell that has a point."""
    return int(assignment.dwell[assignment.dwell >= 0][0]) + 1


def _next_best(best: Assignment, expected_mm: FloatArray, measured_mm: FloatArray) -> tuple[int, float] | None:
    """(shift, rms in mm) of the best shift of all points by whole dwells that leaves most of them one."""
    points = np.flatnonzero(best.dwell >= 0)
    results = []
    for shift in range(-len(expected_mm) + 1, len(expected_mm)):
        dwell = best.dwell[points] + shift
        inside = (dwell >= 0) & (dwell < len(expected_mm))
        if shift and inside.sum() >= max(3, _MOST * len(points)):
            rms_mm = distances_rms_mm(expected_mm[dwell[inside]], measured_mm[points[inside]])
            results.append((rms_mm, shift))
    if not results:
        return None
    rms_mm, shift = min(results)
    return shift, rms_mm
