"""How well the loop keeps time: statistics of period, lateness and cost, in shared memory of fixed size."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from compd.live.memory import shared_floats

BIN_US = 1.0
_BINS = 10_000  # 10 ms; later ones share the last bin, the largest is kept exactly


class Histogram:
    """Durations counted in bins of 1 us, for their median and other quantiles. One process adds, others read."""

    def __init__(self) -> None:
        numbers = shared_floats(_BINS + 3)
        self._counts = numbers[: _BINS + 1]
        self._totals = numbers[_BINS + 1 :]

    @property
    def count(self) -> int:
        """How many durations were added."""
        return int(self._totals[0])

    @property
    def counts(self) -> npt.NDArray[np.float64]:
        """How many durations were in each bin of `BIN_US`, the last one for all that are longer."""
        return self._counts.copy()

    @property
    def largest_us(self) -> float:
        """The longest one, us; 0.0 where none was added."""
        return float(self._totals[1])

    def add(self, duration_s: float) -> None:
        """Count one duration; a negative one counts as zero."""
        us = max(duration_s * 1e6, 0.0)
        self._counts[min(int(us / BIN_US), _BINS)] += 1
        totals = self._totals
        totals[0] += 1
        totals[1] = max(totals[1], us)

    def quantile_us(self, share: float) -> float:
        """Upper edge of the bin up to which `share` of the durations lie; nan where none was added."""
        if not self.count:
            return math.nan
        bin_ = int(np.searchsorted(np.cumsum(self._counts), math.ceil(share * self.count)))
        return self.largest_us if bin_ >= _BINS else min((bin_ + 1) * BIN_US, self.largest_us)

    def summary(self) -> dict[str, float]:
        """Median, 99th percentile and largest; {} where none was added."""
        if not self.count:
            return {}
        return {
            "median_us": round(self.quantile_us(0.5), 1),
            "p99_us": round(self.quantile_us(0.99), 1),
            "largest_us": round(self.largest_us, 1),
        }


class LoopTiming:
    """Timing of the loop, and the grid of its ticks. The loop that has the turn writes, others read.

    A loop that takes over goes on with both: its ticks are on the same grid, its cycles are added to the others'.
    """

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self.lateness = Histogram()
        self.cost = Histogram()
        # origin of the grid (s), cycles, missed, periods, their mean (s), sum of squared deviations (s2), last tick
        self._numbers = shared_floats(7)
        self._last_start_s = math.nan

    @property
    def cycles(self) -> int:
        """Cycles that were computed."""
        return int(self._numbers[1])

    @property
    def missed(self) -> int:
        """Cycles that were skipped, because one before them took too long or there was no loop."""
        return int(self._numbers[2])

    @property
    def origin_s(self) -> float:
        """Monotonic time (s) of tick 0; 0.0 before the first loop has begun."""
        return float(self._numbers[0])

    def begin(self, now_s: float) -> int:
        """Begin to cycle at `now_s`: the number of the next tick, or of the last one where no loop has computed it.

        The first loop to begin sets the grid. For another one, ticks that went by since the loop before it are missed.
        """
        if not self.origin_s:
            self._numbers[0] = now_s
            return 1
        following = int(self._numbers[6]) + 1
        tick = max(following, math.floor((now_s - self.origin_s) / self.period_s))
        self._numbers[2] += tick - following
        return tick

    def note_start(self, wake_s: float, now_s: float) -> None:
        """A cycle begins at `now_s` that should have begun at `wake_s`."""
        self.lateness.add(now_s - wake_s)
        period_s = now_s - self._last_start_s
        if math.isfinite(period_s):  # Welford's running mean and variance
            numbers = self._numbers
            periods, mean_s = numbers[3] + 1, numbers[4]
            delta = period_s - mean_s
            mean_s += delta / periods
            numbers[3], numbers[4] = periods, mean_s
            numbers[5] += delta * (period_s - mean_s)
        self._last_start_s = now_s

    def note_end(self, tick: int, start_s: float, now_s: float, missed: int) -> None:
        """Cycle `tick`, which began at `start_s`, ends at `now_s`; `missed` cycles after it are skipped."""
        self.cost.add(now_s - start_s)
        self._numbers[6] = tick + missed
        self._numbers[1] += 1
        self._numbers[2] += missed

    def note_missed(self, ticks: int) -> None:
        """So many ticks went by before a cycle could begin."""
        self._numbers[2] += ticks

    def summary(self) -> dict[str, Any]:
        """For STATUS; keys that have not been measured yet are absent."""
        summary: dict[str, Any] = {"rate_hz": 1 / self.period_s, "cycles": self.cycles, "missed_cycles": self.missed}
        periods, mean_s, squares_s2 = self._numbers[3:6].tolist()
        if periods > 1:
            summary["period_mean_ms"] = round(mean_s * 1e3, 6)
            summary["period_deviation_ms"] = round(math.sqrt(squares_s2 / (periods - 1)) * 1e3, 6)
        summary |= {f"lateness_{name}": value for name, value in self.lateness.summary().items()}
        return summary | {f"cycle_{name}": value for name, value in self.cost.summary().items()}
