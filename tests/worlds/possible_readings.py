"""Whether the readings of one channel can come from a part without a fault: what it can do, what its gauge may show.

Streaming: constant memory for each channel, and no loop over earlier readings.
"""

from __future__ import annotations

import math

_UNKNOWN = math.inf


class PossibleMotion:
    """Speeds (mm/s) that a length with |x''| <= A may have after all readings so far.

    A reading says: the length was within `noise_mm` of its value, at its time or up to `late_s` later. With exact
    values and times the interval of speeds is the exact reachable set, from which the place at a reading is known.
    Noise and times make the place a box beside the interval, which contains the reachable set. So the interval errs to
    one side: what it calls impossible is impossible, and what it calls possible is nearly always so. What is counted as
    visible can therefore be shown; a fault near the limit may be left out.
    """

    __slots__ = ("_acceleration", "_fastest", "_half_s", "_high", "_low", "_noise_mm", "_place_mm", "_time_s")

    def __init__(self, acceleration: float, noise_mm: float, fastest: float = _UNKNOWN) -> None:
        """`acceleration`: A, mm/s2; `fastest`: largest speed, mm/s; inf where they are not stated."""
        self._acceleration = acceleration
        self._noise_mm = noise_mm
        self._fastest = fastest
        self._time_s = math.nan
        self._place_mm = self._half_s = 0.0
        self._low, self._high = -fastest, fastest

    @property
    def speeds(self) -> tuple[float, float]:
        """Lowest and highest possible speed now, mm/s."""
        return self._low, self._high

    def follow(self, time_s: float, value_mm: float, late_s: float) -> bool:
        """Whether a reading can follow the ones before it. One that cannot is the first of a new motion."""
        half_s = 0.5 * late_s
        time_s += half_s
        passed_s = time_s - self._time_s
        change_mm = value_mm - self._place_mm
        if not passed_s > half_s + self._half_s:
            if math.isnan(passed_s):  # the first
                self._begin(time_s, value_mm, half_s)
                return True
            return self._repeats(change_mm, passed_s + half_s + self._half_s)
        acceleration = self._acceleration
        if acceleration == _UNKNOWN:
            possible = abs(change_mm) <= 2 * self._noise_mm + self._fastest * (passed_s + half_s + self._half_s)
            self._place_mm, self._time_s, self._half_s = value_mm, time_s, half_s
            return possible
        low, high = self._low, self._high
        if high == _UNKNOWN:
            return self._first_speeds(time_s, value_mm, half_s)
        gain = acceleration * passed_s
        half = 0.5 * gain
        fastest = high if high > -low else -low
        off_mm = (
            2 * self._noise_mm
            + fastest * (self._half_s + half_s)
            + gain * half_s
            + 0.5 * acceleration * (self._half_s * self._half_s + half_s * half_s)
        )
        least, most = (change_mm - off_mm) / passed_s, (change_mm + off_mm) / passed_s
        if low > most + half or high < least - half:
            self._begin(time_s, value_mm, half_s)
            return False
        # fastest end: from the lowest speed with which the part comes so far, first faster, then slower
        start = min(max(low, most - half), high)
        top = start + gain * (math.sqrt(2.0 + 2.0 * min((most - start) / half, 1.0)) - 1.0)
        start = min(max(low, least + half), high)
        bottom = start - gain * (math.sqrt(2.0 - 2.0 * max((least - start) / half, -1.0)) - 1.0)
        limit = self._fastest
        if bottom > limit or top < -limit:
            self._begin(time_s, value_mm, half_s)
            return False
        self._low = bottom if bottom > -limit else -limit
        self._high = top if top < limit else limit
        self._place_mm, self._time_s, self._half_s = value_mm, time_s, half_s
        return True

    def _begin(self, time_s: float, value_mm: float, half_s: float) -> None:
        self._place_mm, self._time_s, self._half_s = value_mm, time_s, half_s
        self._low, self._high = -self._fastest, self._fastest

    def _repeats(self, change_mm: float, within_s: float) -> bool:
        """Whether a reading of nearly the same time can show as much else; the first of the two is kept."""
        fastest = max(self._high, -self._low) + (self._acceleration * within_s if within_s > 0 else 0.0)
        return abs(change_mm) <= 2 * self._noise_mm + (fastest * within_s if within_s > 0 else 0.0)

    def _first_speeds(self, time_s: float, value_mm: float, half_s: float) -> bool:
        """The speeds that the first two readings leave; always some, where no speed is stated."""
        change_mm, noise_mm, window_s = value_mm - self._place_mm, 2 * self._noise_mm, half_s + self._half_s
        shortest_s, longest_s = time_s - self._time_s - window_s, time_s - self._time_s + window_s
        least, most = change_mm - noise_mm, change_mm + noise_mm
        spread = self._acceleration * (0.5 * longest_s + half_s)
        self._low = least / (longest_s if least > 0 else shortest_s) - spread
        self._high = most / (shortest_s if most > 0 else longest_s) + spread
        self._place_mm, self._time_s, self._half_s = value_mm, time_s, half_s
        return True


class PossibleChange:
    """Values that a quantity may have, which changes by no more than a rate: the exact set, an interval."""

    __slots__ = ("_high", "_highest", "_low", "_lowest", "_noise", "_per_s", "_time_s")

    def __init__(self, per_s: float, noise: float, lowest: float = -math.inf, highest: float = math.inf) -> None:
        """`per_s`: fastest change a second; `lowest`, `highest`: of what is measured."""
        self._per_s, self._noise = per_s, noise
        self._lowest, self._highest = lowest, highest
        self._low, self._high = lowest, highest
        self._time_s = math.nan

    def follow(self, time_s: float, value: float, late_s: float) -> bool:
        """As of `PossibleMotion.follow`."""
        passed_s = time_s - self._time_s
        change = math.inf if math.isnan(passed_s) else self._per_s * (passed_s + late_s)
        low = max(self._low - change, value - self._noise, self._lowest)
        high = min(self._high + change, value + self._noise, self._highest)
        self._time_s = time_s
        possible = low <= high
        self._low, self._high = (low, high) if possible else (value - self._noise, value + self._noise)
        return possible


# Equal readings, in times of how often a value is usually repeated, that show a gauge that is stuck: chance makes them
# with a probability below exp(-40).
_STREAK = 40.0
_MIN_CHANGES = 100
_SAME = 1e-9


class RepeatedValue:
    """Whether a gauge whose noise exceeds its last digit repeats one value, which noise does not allow."""

    __slots__ = ("_changes", "_noise", "_readings", "_repeats", "_step", "_value")

    def __init__(self, noise: float) -> None:
        """`noise`: standard deviation of a reading; nan where it is not stated, of which nothing is said then."""
        self._noise = noise
        self._value = self._step = math.inf
        self._readings = self._changes = self._repeats = 0

    def follow(self, value: float) -> bool:
        """Whether noise allows this reading, too."""
        self._readings += 1
        change = abs(value - self._value)
        if change > _SAME:
            self._step = min(self._step, change)
            self._value = value
            self._changes += 1
            self._repeats = 0
            return True
        self._repeats += 1
        return not (
            self._repeats > _STREAK
            and self._changes >= _MIN_CHANGES
            and self._noise >= self._step - _SAME
            and self._repeats > _STREAK * (self._readings - self._repeats) / self._changes
        )
