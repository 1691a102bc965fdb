"""The dwell of each point of an instrument, from the names of the points, checked by the distances between them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.joining.distances import MAX_RMS_MM, RigidMotion, distances_rms_mm, is_spread, largest_rms_mm, lay_over

_LAST_NUMBER = re.compile(r"(?:.*\D)?0*(\d+)")
# Most rounds of the robust registration: points far off are left out until their set stays the same.
_ROUNDS = 10
_WRONG_SIGMAS = 6.0


@dataclass(frozen=True)
class NamedAssignment:
    """The dwell of each of G points by its name."""

    dwell: IntArray  #: (G,) number of the dwell from 0, -1 for none
    unknown: tuple[str, ...]  #: names that no dwell has
    without: tuple[str, ...]  #: ids of dwells that no point has
    #: names of places visited several times of which it cannot be told when each was measured
    unclear: tuple[str, ...] = ()


@dataclass(frozen=True)
class NameCheck:
    """Result of checking an assignment by name against the distances.

    Attributes
    ----------
    rms_mm : of the distances between points, of those that are not wrong. wrong : (W,) points that are not where their
    dwell is. nearest : (W,) the dwell where each would be, -1 for none. off_mm : (W,) how far each is from its own.
    why : that nothing can be told, else "".
    """

    rms_mm: float
    allowed_mm: float
    wrong: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    nearest: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    off_mm: FloatArray = field(default_factory=lambda: np.zeros(0))
    why: str = ""


def assign_by_name(ids: Sequence[str], sizes: Sequence[int], names: Sequence[str]) -> NamedAssignment:
    """The dwell of each named point.

    ids : of S dwells in the order of time, "" for none. sizes : rows of each dwell.
    names : of G points in the order of time, or of the file where they have none.

    A name is an id as it stands, without regard to case; else by its last number, as P001 is 1, where ids are numbers
    and no other name has the same one. A name measured as often as its place was visited: the k-th time at the k-th
    visit; measured as often as there are rows of the recording, one after the other; in as many successions of lines as
    there were visits, the k-th of them at the k-th visit; measured several times at a place visited once: repeats. Any
    other is unclear, and so are all names of places visited several times if this does not leave these visits in the
    order of time: then the points are not listed in the order in which they were measured.
    """
    id_of = _ids_of_names(ids, names)
    dwell = np.full(len(names), -1, dtype=np.int64)
    unclear, visited_again = [], []
    for name, own in id_of.items():
        points = [j for j, other in enumerate(names) if other == name]
        dwells = [i for i, other in enumerate(ids) if other == own]
        run = np.cumsum([0, *(later - earlier > 1 for earlier, later in pairwise(points))])
        if len(dwells) == 1:
            dwell[points] = dwells[0]
        elif len(dwells) == len(points):
            dwell[points] = dwells
        elif sum(sizes[i] for i in dwells) == len(points):
            dwell[points] = np.repeat(dwells, [sizes[i] for i in dwells])
        elif len(dwells) == run[-1] + 1:
            dwell[points] = np.array(dwells)[run]
        else:
            unclear.append(name)
        if len(dwells) > 1:
            visited_again += points
    at_visits = dwell[np.sort(np.array(visited_again, dtype=np.int64))]
    if (np.diff(at_visits[at_visits >= 0]) < 0).any():
        dwell[visited_again] = -1
        unclear = list(dict.fromkeys(names[j] for j in sorted(visited_again)))
    unknown = tuple(dict.fromkeys(name for name in names if name not in id_of))
    taken = {*id_of.values()}
    without = tuple(dict.fromkeys(own for own in ids if own and own not in taken))
    return NamedAssignment(dwell, unknown, without, tuple(unclear))


def _ids_of_names(ids: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Name -> the id that it means; names without one are left out."""
    by_text = {own.strip().casefold(): own for own in ids if own}
    different = list(dict.fromkeys(names))
    id_by_name = {name: by_text[name.strip().casefold()] for name in different if name.strip().casefold() in by_text}
    by_number = {int(own): own for own in by_text.values() if own.isdecimal()}
    if len(by_number) < len(by_text):
        return id_by_name
    numbers = {
        name: int(match[1]) for name in different if name not in id_by_name and (match := _LAST_NUMBER.fullmatch(name))
    }
    for name, number in numbers.items():
        alone = list(numbers.values()).count(number) == 1 and by_number.get(number) not in id_by_name.values()
        if number in by_number and alone:
            id_by_name[name] = by_number[number]
    return id_by_name


def check_names(
    expected_mm: FloatArray, measured_mm: FloatArray, dwell: IntArray, near_mm: float, in_M: bool = False
) -> NameCheck:
    """Whether the points with a dwell have the distances of their dwells, and the exceptions.

    expected_mm : (S, d). measured_mm : (G, d). dwell : (G,) -1 for none. near_mm : no point this near is wrong.
    in_M : the points are measured in {M}: nothing is laid over, and any number of places will do.
    """
    points = np.flatnonzero(dwell >= 0)
    q, p = measured_mm[points], expected_mm[dwell[points]]
    if not in_M and not is_spread(p):
        return NameCheck(np.nan, np.nan, why="too few different places to check the names by their distances")
    allowed_mm = MAX_RMS_MM if in_M else largest_rms_mm(p)
    right = _in_place(p, q, allowed_mm, near_mm) if in_M else _consistent(p, q, allowed_mm, near_mm)
    if not right.any() or not (in_M or is_spread(p[right])):
        return NameCheck(
            distances_rms_mm(p, q), allowed_mm, why="the distances between the points are not their dwells'"
        )
    motion = RigidMotion(np.eye(3), np.zeros(3)) if in_M else lay_over(q[right], p[right])
    wrong = np.flatnonzero(~right)
    from_all = np.linalg.norm(expected_mm[None, :, :] - motion(q[wrong])[:, None, :], axis=2)
    limit_mm = _limit_mm(np.linalg.norm(p[right] - motion(q[right]), axis=1), allowed_mm, near_mm)
    nearest = from_all.argmin(axis=1) if len(wrong) else np.zeros(0, dtype=np.int64)
    fits = from_all[np.arange(len(wrong)), nearest] <= limit_mm
    return NameCheck(
        distances_rms_mm(p[right], q[right]),
        allowed_mm,
        points[wrong],
        np.where(fits, nearest, -1).astype(np.int64),
        np.linalg.norm(p[wrong] - motion(q[wrong]), axis=1),
    )


def _in_place(p: FloatArray, q: FloatArray, allowed_mm: float, near_mm: float) -> BoolArray:
    """(N,) pairs in one frame whose distance is typical."""
    residual_mm = np.linalg.norm(p - q, axis=1)
    return np.asarray(residual_mm <= _limit_mm(residual_mm, allowed_mm, near_mm))


def _limit_mm(residual_mm: FloatArray, allowed_mm: float, near_mm: float) -> float:
    """(N,) wrong points: farther from their dwell than 6 times the typical residual, and than `near_mm`."""
    return float(max(min(_WRONG_SIGMAS * 1.5 * float(np.median(residual_mm)), 3.0 * allowed_mm), near_mm))


def _consistent(p: FloatArray, q: FloatArray, allowed_mm: float, near_mm: float) -> BoolArray:
    """(N,) the pairs whose distances agree with those of most others, refined by laying one over the other."""
    differences = np.abs(np.linalg.norm(p[:, None] - p[None], axis=2) - np.linalg.norm(q[:, None] - q[None], axis=2))
    right: BoolArray = np.asarray(np.median(differences, axis=1) <= 3.0 * allowed_mm)
    for _ in range(_ROUNDS):
        if right.sum() < 3 or not is_spread(p[right]):
            break
        motion = lay_over(q[right], p[right])
        residual_mm = np.linalg.norm(p - motion(q), axis=1)
        new = np.asarray(residual_mm <= _limit_mm(residual_mm[right], allowed_mm, near_mm))
        if (new == right).all():
            break
        right = new
    return right
