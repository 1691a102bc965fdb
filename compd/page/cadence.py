"""When a row is kept: so many a second, whatever the jitter of what comes."""

from __future__ import annotations

import math

# A row that comes so much too early, s, is on time.
_EARLY_S = 0.025


class Cadence:
    """Times of rows that come `1 / rate_hz` seconds after one another; a clock that is set back does not stop them."""

    def __init__(self, rate_hz: float) -> None:
        self._every_s = 1 / rate_hz
        self._due_s = -math.inf

    def is_due(self, time_s: float) -> bool:
        """Whether a row is wanted at `time_s` (s)."""
        early_s = self._due_s - time_s
        return early_s <= _EARLY_S or early_s > 2 * self._every_s

    def kept(self, time_s: float) -> None:
        """A row of `time_s` (s) has been kept."""
        on_time = abs(time_s - self._due_s) < self._every_s / 2
        self._due_s = (self._due_s if on_time else time_s) + self._every_s
