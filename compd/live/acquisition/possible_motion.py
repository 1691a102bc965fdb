"""Whether a motion with limited acceleration and speed explains a gauge's readings.

The time of a sample is known to within a window: a reply that took longer than others may have been sampled later. So
the mean speed between two readings is known as an interval, and so is every speed that can follow from it. Readings are
possible where an interval is left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

# Baseline (s) of the previous speed estimate; much longer than one reply.
BASE_S = 0.02
# Sampling-time uncertainty (s) of a reply with normal latency.
WINDOW_S = 1e-3


class GaugeSample(NamedTuple):
    """A reading as a sample of motion: value (mm), time (s), and its largest delay (s)."""

    value: float
    time_s: float
    window_s: float


class MotionLimits(NamedTuple):
    """Limits of the measured part: speed (mm/s), acceleration (mm/s2); inf for no limit."""

    speed: float = math.inf
    acceleration: float = math.inf


class Interval(NamedTuple):
    """Numbers from `low` to `high`; empty if low > high."""

    low: float
    high: float

    def widened(self, by: float) -> Interval:
        """The interval widened by `by` on either side."""
        return Interval(self.low - by, self.high + by)

    def common(self, other: Interval) -> Interval:
        """The numbers in both."""
        return Interval(max(self.low, other.low), min(self.high, other.high))

    @property
    def empty(self) -> bool:
        return self.low > self.high


def mean_speed(start: GaugeSample, end: GaugeSample, tolerance_mm: float) -> Interval:
    """The mean speeds (mm/s) allowed by two readings, each uncertain by half of `tolerance_mm`."""
    shortest_s = max(0.0, end.time_s - start.time_s - start.window_s)
    longest_s = end.time_s - start.time_s + end.window_s
    change_mm = end.value - start.value
    return Interval(
        _speed(change_mm - tolerance_mm, longest_s, shortest_s), _speed(change_mm + tolerance_mm, shortest_s, longest_s)
    )


def _speed(change_mm: float, positive_in_s: float, negative_in_s: float) -> float:
    duration_s = positive_in_s if change_mm > 0 else negative_in_s
    return change_mm / duration_s if duration_s > 0 else math.copysign(math.inf, change_mm)


ANY_SPEED = Interval(-math.inf, math.inf)


def is_possible(
    samples: Sequence[GaugeSample],
    tolerance_mm: float,
    limits: MotionLimits,
    before: Interval = ANY_SPEED,
    base_s: float = 0.0,
) -> bool:
    """Whether a part can have come from the first of these samples, ordered by time, over all others to the last.

    before : its mean speed (mm/s) over `base_s` (s) until the first.
    """
    allowed = Interval(-limits.speed, limits.speed)
    now = before.common(allowed)
    if now.empty:
        now = before
    for start, end in pairwise(samples):
        passed_s = end.time_s - start.time_s + end.window_s
        now = now.widened(limits.acceleration * (base_s + passed_s) / 2)
        now = now.common(allowed).common(mean_speed(start, end, tolerance_mm))
        if now.empty:
            return False
        base_s = passed_s
    return True


def rest_to_rest_mm(limits: MotionLimits, duration_s: float, tolerance_mm: float) -> float:
    """Largest motion (mm) within `duration_s` (s) of a part at rest before and after it.

    Half of the time it accelerates, half of it it brakes: a t^2 / 4. It may have begun earlier and end later, by the
    time in which it moves by no more than the readings' tolerance.
    """
    if math.isinf(limits.acceleration):
        return limits.speed * duration_s + tolerance_mm
    longest_s = duration_s + 2 * math.sqrt(2 * tolerance_mm / limits.acceleration)
    return min(limits.acceleration * longest_s**2 / 4, limits.speed * longest_s) + tolerance_mm


def unseen_jump_mm(limits: MotionLimits, poll_s: float, tolerance_mm: float) -> float:
    """Largest jump (mm) of a part at rest that motion can explain; inf without limits.

    poll_s : from one reading to the next, s.
    """
    return rest_to_rest_mm(limits, poll_s + WINDOW_S, tolerance_mm)
