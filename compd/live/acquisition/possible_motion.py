"""Whether what a gauge measures can have moved as its readings say, with a limited acceleration and speed.

The time of a sample is known to within a window: a reply that took longer than others may have been sampled later. So
the mean speed between two readings is known as an interval, and so is every speed that can follow from it. Readings are
possible where an interval is left.
"""

from __future__ import annotations

import math
from typing import NamedTuple

# Over this time, s, the speed is measured that the measured part had before: long beside the time that a reply takes.
BASE_S = 0.02
# Of a reply that took no longer than others.
WINDOW_S = 1e-3
# Two readings of the same value differ by less than this many standard deviations of one: 6 sigma of a difference.
SAME_VALUE_SIGMAS = 6 * math.sqrt(2)


class GaugeSample(NamedTuple):
    """A reading as a sample of motion: value (mm), time (s), and by how much it may have been later (s)."""

    value: float
    time_s: float
    window_s: float


class MotionLimits(NamedTuple):
    """What the measured part can do: speed (mm/s), acceleration (mm/s2); inf where no limit is given."""

    speed: float = math.inf
    acceleration: float = math.inf


class Interval(NamedTuple):
    """Numbers from `low` to `high`; empty where low > high."""

    low: float
    high: float

    def widened(self, by: float) -> Interval:
        """All numbers that are at most `by` away."""
        return Interval(self.low - by, self.high + by)

    def common(self, other: Interval) -> Interval:
        """The numbers in both."""
        return Interval(max(self.low, other.low), min(self.high, other.high))

    @property
    def empty(self) -> bool:
        return self.low > self.high


def mean_speed(start: GaugeSample, end: GaugeSample, tolerance_mm: float) -> Interval:
    """The mean speeds, mm/s, that two readings allow, each of them uncertain by half of `tolerance_mm`."""
    shortest_s = max(0.0, end.time_s - start.time_s - start.window_s)
    longest_s = end.time_s - start.time_s + end.window_s
    change_mm = end.value - start.value
    return Interval(
        _speed(change_mm - tolerance_mm, longest_s, shortest_s), _speed(change_mm + tolerance_mm, shortest_s, longest_s)
    )


def _speed(change_mm: float, positive_in_s: float, negative_in_s: float) -> float:
    duration_s = positive_in_s if change_mm > 0 else negative_in_s
    return change_mm / duration_s if duration_s > 0 else math.copysign(math.inf, change_mm)


def is_possible(
    before: Interval,
    base_s: float,
    last: GaugeSample,
    first: GaugeSample,
    second: GaugeSample,
    tolerance_mm: float,
    limits: MotionLimits,
) -> bool:
    """Whether the part can have come from `last` over `first` to `second`.

    before : its mean speed (mm/s) over `base_s` (s) until `last`.
    """
    first_s = first.time_s - last.time_s + first.window_s
    second_s = second.time_s - first.time_s + second.window_s
    allowed = Interval(-limits.speed, limits.speed)
    now = before.common(allowed)
    if now.empty:
        now = before
    for start, end, between_s in (
        (last, first, (base_s + first_s) / 2),
        (first, second, (first_s + second_s) / 2),
    ):
        now = now.widened(limits.acceleration * between_s).common(allowed).common(mean_speed(start, end, tolerance_mm))
        if now.empty:
            return False
    return True


def rest_to_rest_mm(limits: MotionLimits, duration_s: float, tolerance_mm: float) -> float:
    """How far a part can move, mm, that readings show at rest before and after `duration_s` (s).

    Half of the time it accelerates, half of it it brakes: a t^2 / 4. It may have begun earlier and end later, by the
    time in which it moves by no more than the readings' tolerance.
    """
    if math.isinf(limits.acceleration):
        return limits.speed * duration_s + tolerance_mm
    longest_s = duration_s + 2 * math.sqrt(2 * tolerance_mm / limits.acceleration)
    return min(limits.acceleration * longest_s**2 / 4, limits.speed * longest_s) + tolerance_mm


def unseen_jump_mm(limits: MotionLimits, poll_s: float, tolerance_mm: float) -> float:
    """The largest jump of a part at rest that may be motion, mm; inf without limits.

    poll_s : from one reading to the next, s.
    """
    return rest_to_rest_mm(limits, poll_s + WINDOW_S, tolerance_mm)
