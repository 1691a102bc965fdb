"""How a part moved until its last reading, and where its next one is expected."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from itertools import pairwise

from compd.live.acquisition.possible_motion import ANY_SPEED, BASE_S, GaugeSample, Interval, MotionLimits, mean_speed

# Samples of motion that are kept.
KEPT = 32
# Readings in a row, each further the same way, that hum and noise do not show.
_MOVES_FOR = 8
# Allowed growth of an acceleration that is already present (factor).
_ACCELERATION_MARGIN = 2.0


class MotionBefore:
    """The last samples of one length."""

    def __init__(self, tolerance_mm: float, limits: MotionLimits) -> None:
        """`tolerance_mm`: by which two readings of the same value may differ. `limits`: of the part's motion."""
        self.history: deque[GaugeSample] = deque(maxlen=KEPT)  #: in the order of time; empty before the first
        self._tolerance_mm = tolerance_mm
        self._limits = limits
        self._speed_at: tuple[GaugeSample | None, tuple[Interval, float]] = None, (ANY_SPEED, 0.0)

    @property
    def last(self) -> GaugeSample:
        """The newest sample. Raises IndexError before the first."""
        return self.history[-1]

    @property
    def rested(self) -> bool:
        """Whether the part was at rest at its last sample."""
        before, _ = self.speed()
        return math.isfinite(before.low) and before.low <= 0.0 <= before.high

    @property
    def lasting_mm_per_s(self) -> float:
        """Speed of a part that has gone one way for a while, mm/s; 0 of one that stands or hums."""
        values = [sample.value for sample in self.history][-_MOVES_FOR:]
        ways = {later > earlier for earlier, later in pairwise(values)}
        return _certain(self.speed()[0]) if len(ways) == 1 else 0.0

    def expects(self, sample: GaugeSample, others: Iterable[GaugeSample] = ()) -> bool:
        """Whether a sample is within its predicted range, given the noise and the present acceleration.

        others : answers out of that range. A sample that is as far from the prediction as they are confirms them.
        """
        last = self.last
        before, base_s = self.speed()
        passed_s = sample.time_s - last.time_s
        speed, acceleration, tolerance_mm = 0.0, 0.0, self._tolerance_mm
        if speed := _certain(before):
            tolerance_mm += (before.high - before.low) / 2 * passed_s
            acceleration = min(_ACCELERATION_MARGIN * self._acceleration(speed, base_s), self._limits.acceleration)
        slack_mm = tolerance_mm + abs(speed) * (sample.window_s + last.window_s)
        slack_mm += acceleration * passed_s * (passed_s + base_s) / 2
        off = self.off_mm(sample, speed)
        return abs(off) <= slack_mm and all(abs(off) <= abs(off - self.off_mm(other, speed)) for other in others)

    def off_mm(self, sample: GaugeSample, mm_per_s: float) -> float:
        """Distance (mm) of a sample from where the last one leads with this speed."""
        return sample.value - self.last.value - mm_per_s * (sample.time_s - self.last.time_s)

    def _base(self) -> int | None:
        """Index of the sample from which the speed until the last one is measured."""
        history = self.history
        _, last_s, window_s = history[-1]
        latest_s = last_s - max(BASE_S, 4 * window_s)
        for k in range(len(history) - 2, -1, -1):
            if history[k].time_s <= latest_s:
                return k
        return None

    def speed(self) -> tuple[Interval, float]:
        """Mean speed (mm/s) until the last sample, and over how long (s); without bounds where it is not known."""
        if self._speed_at[0] is not self.history[-1]:  # one reading is judged by it several times
            self._speed_at = self.history[-1], self._speed()
        return self._speed_at[1]

    def _speed(self) -> tuple[Interval, float]:
        base = self._base()
        if base is None:
            first_s = self.history[-1].time_s - self.history[0].time_s
            return ANY_SPEED, max(first_s, 0.0)
        start, last = self.history[base], self.history[-1]
        return mean_speed(start, last, self._tolerance_mm), last.time_s - start.time_s

    def _acceleration(self, speed: float, base_s: float) -> float:
        """Acceleration (mm/s2, absolute) shown by the samples: from the speed before to `speed`, over `base_s`."""
        base = self._base()
        if base is None or base == 0:
            return 0.0
        middle = self.history[base]
        for k in range(base - 1, -1, -1):
            start = self.history[k]
            if middle.time_s - start.time_s >= BASE_S:
                earlier = (middle.value - start.value) / (middle.time_s - start.time_s)
                return abs(speed - earlier) / ((middle.time_s - start.time_s + base_s) / 2)
        return 0.0


def _certain(speed: Interval) -> float:
    """The middle of a speed (mm/s) that is certainly not 0; else 0."""
    moves = math.isfinite(speed.low) and math.isfinite(speed.high) and (speed.low > 0 or speed.high < 0)
    return (speed.low + speed.high) / 2 if moves else 0.0
