"""Statistics of `compd gauge watch`: rate, age, noise and faults of one gauge."""

from __future__ import annotations

import math
import statistics
from collections import Counter, deque
from collections.abc import Sequence

from compd.gauge import Channel, Quality, Reading

WINDOW = 200  # polls for rate and noise


class GaugeStatistics:
    """Fed with every poll; the newest `WINDOW` of them count for rate and noise, all of them for the faults."""

    def __init__(self, channels: Sequence[Channel]) -> None:
        self.channels = channels
        self.polls = 0
        self.faults: Counter[Quality] = Counter()  # number of polls
        self.last: Sequence[Reading] = ()
        self._values: list[deque[float]] = [deque(maxlen=WINDOW) for _ in channels]
        self._polled_s: deque[float] = deque(maxlen=WINDOW)
        self._good_s = [math.nan for _ in channels]

    def add(self, readings: Sequence[Reading], now_s: float) -> None:
        """One poll that ended at `now_s`, one reading per channel."""
        self.polls += 1
        self.last = readings
        self._polled_s.append(now_s)
        self.faults.update({reading.quality for reading in readings if not reading.ok})
        for k, reading in enumerate(readings):
            if reading.ok:
                self._values[k].append(reading.value)
                self._good_s[k] = reading.time_s

    @property
    def rate_hz(self) -> float:
        """Polls per second; nan before the second one."""
        if len(self._polled_s) < 2 or self._polled_s[-1] == self._polled_s[0]:
            return math.nan
        return (len(self._polled_s) - 1) / (self._polled_s[-1] - self._polled_s[0])

    def age_s(self, channel: int, now_s: float) -> float:
        """Time (s) since the request of the channel's newest good reading; nan without one."""
        return now_s - self._good_s[channel]

    def noise(self, channel: int) -> float:
        """Standard deviation of the channel's values, in its unit; nan of fewer than two. A moving part adds to it."""
        values = self._values[channel]
        return statistics.stdev(values) if len(values) > 1 else math.nan

    def mean(self, channel: int) -> float:
        """Mean of the channel's values, in its unit; nan of none."""
        values = self._values[channel]
        return statistics.fmean(values) if values else math.nan
