"""Faults of each gauge in all and in the last hour, from the counts in STATUS."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

Message = Mapping[str, Any]

HOUR_S = 3600.0
# Interval (s) of stored counts, and thus the accuracy of the hour.
KEPT_EVERY_S = 60.0


class FaultCounts:
    """Counts of one daemon since the page has seen them; reset when a count falls, which shows a new start."""

    def __init__(self) -> None:
        self._kept: deque[tuple[float, dict[str, int]]] = deque(maxlen=round(HOUR_S / KEPT_EVERY_S) + 1)
        self._newest: dict[str, int] = {}

    def note(self, time_s: float, status: Message) -> None:
        """Take the counts of a STATUS received at `time_s` (Unix, s)."""
        lines = status["lines"].values()
        counts = {name: sum(gauge["faults"].values()) for line in lines for name, gauge in line["gauges"].items()}
        if any(counts.get(name, 0) < count for name, count in self._newest.items()):
            self._kept.clear()
        if not self._kept or time_s >= self._kept[-1][0] + KEPT_EVERY_S:
            self._kept.append((time_s, counts))
        self._newest = counts

    def summary(self) -> dict[str, Any] | None:
        """None before the first STATUS.

        `since_s` : from when `recent` counts, Unix time, s.  `hour` : whether that is an hour; before, the page has not
        seen one.  `total` : of each gauge, since the daemon's start.  `recent` : of those, since `since_s`.
        """
        if not self._kept:
            return None
        since_s, before = self._kept[0]
        recent = {name: count - before.get(name, 0) for name, count in self._newest.items()}
        whole = len(self._kept) == self._kept.maxlen
        return {"since_s": since_s, "hour": whole, "total": self._newest, "recent": recent}
