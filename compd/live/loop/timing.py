"""How well the loop keeps time: statistics of period, lateness and cost, in fixed memory."""

from __future__ import annotations

import math
from typing import Any

_BIN_US = 5.0
_BINS = 2000  # 10 ms; later ones share the last bin, the largest is kept exactly


class Histogram:
    """Durations counted in bins of 5 us, for their median and their 99th percentile."""

    def __init__(self) -> None:
        self._counts = [0] * (_BINS + 1)
        self.count = 0
        self.largest_us = 0.0

    def add(self, duration_s: float) -> None:
        """Count one duration; a negative one counts as zero."""
        us = max(duration_s * 1e6, 0.0)
        self._counts[min(int(us / _BIN_US), _BINS)] += 1
        self.count += 1
        self.largest_us = max(self.largest_us, us)

    def quantile_us(self, share: float) -> float:
        """Upper edge of the bin up to which `share` of the durations lie; nan where none was added."""
        wanted = math.ceil(share * self.count)
        below = 0
        for i, count in enumerate(self._counts):
            below += count
            if count and below >= wanted:
                return self.largest_us if i == _BINS else min((i + 1) * _BIN_US, self.largest_us)
        return math.nan

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
    """Timing of the loop; only the thread of the loop writes it."""

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self.cycles = 0
        self.missed = 0
        self.lateness = Histogram()
        self.cost = Histogram()
        self._last_start_s = math.nan
        self._mean_s = 0.0
        self._squares_s2 = 0.0
        self._periods = 0

    def note_start(self, wake_s: float, now_s: float) -> None:
        """A cycle begins at `now_s` that should have begun at `wake_s`."""
        self.lateness.add(now_s - wake_s)
        period_s = now_s - self._last_start_s
        if math.isfinite(period_s):  # Welford's running mean and variance
            self._periods += 1
            delta = period_s - self._mean_s
            self._mean_s += delta / self._periods
            self._squares_s2 += delta * (period_s - self._mean_s)
        self._last_start_s = now_s

    def note_end(self, start_s: float, now_s: float, missed: int) -> None:
        """The cycle that began at `start_s` ends; `missed` cycles after it are skipped."""
        self.cost.add(now_s - start_s)
        self.cycles += 1
        self.missed += missed

    def summary(self) -> dict[str, Any]:
        """For STATUS; keys that have not been measured yet are absent."""
        summary: dict[str, Any] = {"rate_hz": 1 / self.period_s, "cycles": self.cycles, "missed_cycles": self.missed}
        if self._periods > 1:
            deviation_s = math.sqrt(self._squares_s2 / (self._periods - 1))
            summary["period_mean_ms"] = round(self._mean_s * 1e3, 6)
            summary["period_deviation_ms"] = round(deviation_s * 1e3, 6)
        summary |= {f"lateness_{name}": value for name, value in self.lateness.summary().items()}
        return summary | {f"cycle_{name}": value for name, value in self.cost.summary().items()}
