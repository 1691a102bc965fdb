"""Summary log, one line a minute, of events that any host on the network can cause: counts instead of single lines."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable

import structlog

EVERY_S = 60.0

_log = structlog.get_logger()


class CountedLog:
    """Counts by kind; used by the event loop's thread alone.

    time_s : monotonic time, s. later : calls a function after a time (s). Both default to those of the running loop.
    """

    def __init__(
        self,
        time_s: Callable[[], float] | None = None,
        later: Callable[[float, Callable[[], None]], object] | None = None,
    ) -> None:
        self._time_s = time_s
        self._later = later
        self._counts: Counter[str] = Counter()
        self._due = False
        self._next_s = 0.0

    def note(self, kind: str) -> None:
        """Count one more event. kind : a key of the log's line."""
        self._counts[kind] += 1
        if self._due:
            return
        self._due = True
        later = self._later or asyncio.get_running_loop().call_later
        later(max(self._next_s - self._now_s(), 0.0), self._write)

    def _write(self) -> None:
        self._due, self._next_s = False, self._now_s() + EVERY_S
        _log.warning("requests were refused, or connections closed", **self._counts)
        self._counts.clear()

    def _now_s(self) -> float:
        return self._time_s() if self._time_s else asyncio.get_running_loop().time()
