"""Row times at a fixed rate, independent of the jitter of the input."""

from __future__ import annotations

import math

# Rows up to this early (s) count as on time.
_EARLY_S = 0.025


class Cadence:
    """Row times `1 / rate_hz` seconds apart; they go on after a clock is set back."""

    def __init__(self, rate_hz: float) -> None:
        self._every_s = 1 / rate_hz
        self._due_s = -math.inf

    def is_due(self, time_s: float) -> bool:
        """Whether a row is due at `time_s` (s)."""
        early_s = self._due_s - time_s
        return early_s <= _EARLY_S or early_s > 2 * self._every_s

    def kept(self, time_s: float) -> None:
        """Note that a row of `time_s` (s) has been kept."""
        on_time = abs(time_s - self._due_s) < self._every_s / 2
        self._due_s = (self._due_s if on_time else time_s) + self._every_s
