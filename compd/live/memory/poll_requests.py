"""Which gauges a client wants to be polled at once, though they rest because they did not answer."""

from __future__ import annotations

from collections.abc import Sequence

from compd.live.memory.shared_array import shared_counters


class PollRequests:
    """Shared by the processes that are forked from now on: the service writes, the gauges' lines read."""

    def __init__(self, gauges: Sequence[str] = ()) -> None:
        """`gauges`: names of those that are polled."""
        self._index = {name: i for i, name in enumerate(gauges)}
        self._count = shared_counters(max(1, len(self._index)))

    def add(self, gauge: str) -> None:
        """Ask for a poll of `gauge`. Raises ValueError, with a text for the client, where it is none that is polled."""
        if gauge not in self._index:
            raise ValueError(f"no gauge that is polled is called {gauge[:40]!r}, allowed: {', '.join(self._index)}")
        self._count[self._index[gauge]] += 1

    def count(self, gauge: str) -> int:
        """How often a poll of `gauge` has been asked for."""
        return self._count[self._index[gauge]] if gauge in self._index else 0
