"""Motion of a scale in a gap of its readings, from the other links' motion and its own before.

A machine whose links follow one path moves them in proportion: the ratio between two links is that before the gap, or
that after it, and at a corner in the gap the way is a sum of both. So the ways of the other links in the gap, and the
ways of all in a short time before and after it, give the way of the link that was not read. Nothing of this needs to
know the machine's geometry or the speed along the path.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from compd.live.acquisition.possible_motion import GaugeSample
from compd.live.memory import Doubt, TrustMemory

# Time (s) before and after a gap over which the ratio of the links' paths is taken: several polls, a nearly straight
# path.
SIDE_S = 0.06
# Least motion (mm) that gives a direction: readings are late by 1 ms, in which a link moves some 0.05 mm.
MIN_WAY_MM = 0.1
# Relative uncertainty of a path from those of other links: links turn while they move, and readings are late.
WAY_SHARE = 0.1
# Two paths are one straight path if their ratios differ by less than this, as the sine of an angle.
_ONE_PATH = 0.2
# A gap is this many times as long as the usual interval.
_GAP = 2.0


class ExpectedWay(NamedTuple):
    """Motion (mm) in a gap and its uncertainty (mm)."""

    way_mm: float
    u_mm: float

    def explains(self, way_mm: float) -> bool:
        """Whether it is that way."""
        return abs(way_mm - self.way_mm) <= self.u_mm


def way_by_links(
    memory: TrustMemory, i: int, before: Sequence[GaugeSample], after: Sequence[GaugeSample]
) -> ExpectedWay | None:
    """The way of scale `i` from the last sample before a gap to the first after it, by the motion of the other links.

    None if they do not say: they have not been read for long enough since, or have not moved before nor after.
    """
    links = [j for j in range(memory.scales) if j != i and memory.doubt_of(j) is Doubt.NONE]
    paths = [_Path(readings) for readings in map(memory.recent, links) if len(readings) > 1]
    start, end = _side_start(before), _side_end(after)
    if not paths or end is None or not all(path.start_s <= start.time_s and end.time_s <= path.end_s for path in paths):
        return None

    def ways_mm(begin: GaugeSample, end: GaugeSample) -> NDArray[np.float64]:
        """(1 + links) of scale `i`, then of the others."""
        others = [path.at(end.time_s) - path.at(begin.time_s) for path in paths]
        return np.array([end.value - begin.value, *others])

    sides = [ways_mm(start, before[-1]), ways_mm(after[0], end)]
    gap_mm = ways_mm(before[-1], after[0])[1:]
    sides = [side for side in sides if np.abs(side[1:]).max() >= MIN_WAY_MM]
    if not sides:
        return None
    units = [side / np.linalg.norm(side[1:]) for side in sides]
    if len(units) == 2:
        cosine = float(units[0][1:] @ units[1][1:])
        if 1.0 - cosine**2 < _ONE_PATH**2:
            units = [(units[0] + math.copysign(1.0, cosine) * units[1]) / 2]
    directions = np.array([unit[1:] for unit in units]).T
    lengths, *_ = np.linalg.lstsq(directions, gap_mm, rcond=None)
    left_mm = float(np.linalg.norm(directions @ lengths - gap_mm))
    way_mm = float(np.array([unit[0] for unit in units]) @ lengths)
    if left_mm > WAY_SHARE * np.linalg.norm(gap_mm) + MIN_WAY_MM:
        return None  # neither one path nor two
    return ExpectedWay(way_mm, WAY_SHARE * float(np.abs(lengths).max()) + MIN_WAY_MM)


def way_by_itself(before: Sequence[GaugeSample], after: Sequence[GaugeSample]) -> ExpectedWay | None:
    """The way in a gap of what moves as fast before as after it; None of what does not."""
    side_end = _side_end(after)
    if side_end is None:
        return None
    speeds = []
    for begin, end in ((_side_start(before), before[-1]), (after[0], side_end)):
        if end.time_s <= begin.time_s or abs(end.value - begin.value) < MIN_WAY_MM:
            return None
        speeds.append((end.value - begin.value) / (end.time_s - begin.time_s))
    mean = sum(speeds) / 2
    if abs(speeds[1] - speeds[0]) > 2 * WAY_SHARE * abs(mean):
        return None
    way_mm = mean * (after[0].time_s - before[-1].time_s)
    return ExpectedWay(way_mm, WAY_SHARE * abs(way_mm) + MIN_WAY_MM)


def _side_start(before: Sequence[GaugeSample]) -> GaugeSample:
    """The sample from which the ratio before a gap is taken."""
    latest_s = before[-1].time_s - SIDE_S
    return next((sample for sample in reversed(before) if sample.time_s <= latest_s), before[0])


def _side_end(after: Sequence[GaugeSample]) -> GaugeSample | None:
    """The sample until which the ratio after a gap is taken; None if it has not come yet."""
    return next((sample for sample in after if sample.time_s >= after[0].time_s + SIDE_S), None)


class _Path:
    """Position of a link at any time, from its last readings."""

    def __init__(self, readings: NDArray[np.float64]) -> None:
        """`readings`: (k, 2) time (s) and value (mm)."""
        self._time_s, self._value_mm = readings[:, 0], readings[:, 1]

    @property
    def start_s(self) -> float:
        """Time (s) of the first known reading."""
        return float(self._time_s[0])

    @property
    def end_s(self) -> float:
        """Time of the last reading, s."""
        return float(self._time_s[-1])

    def at(self, time_s: float) -> float:
        """Position (mm); in a gap of its own, extrapolated from the readings on the nearer side."""
        times, values = self._time_s, self._value_mm
        k = min(max(int(np.searchsorted(times, time_s)), 1), len(times) - 1)
        if times[k] - times[k - 1] > _GAP * float(np.median(np.diff(times))):
            if time_s - times[k - 1] < times[k] - time_s:
                k = max(k - 1, 1)
            elif k + 1 < len(times):
                k += 1
        passed_s = times[k] - times[k - 1]
        share = (time_s - times[k - 1]) / passed_s if passed_s > 0 else 1.0
        return float(values[k - 1] + share * (values[k] - values[k - 1]))
