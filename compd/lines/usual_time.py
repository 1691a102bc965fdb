"""How long a device usually takes, and how long it is waited for."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import deque

# Durations in mind, and the fewest of them that say what is usual.
IN_MIND, FEWEST = 256, 20
# Share of the durations that are usual: the others waited for this computer, which may pause.
USUAL_SHARE = 0.99
# Wait in usual durations, and the shortest wait, s: a busy computer is late by 8 ms, an adapter by 16 ms.
TIMES_USUAL = 3.0
MIN_WAIT_S = 20e-3
# Waits in a row in vain, or one whose bytes come after all, that show a slower device; a single one may have lost a
# byte.
MAX_IN_VAIN = 5


class Durations:
    """The last durations of something, s."""

    def __init__(self) -> None:
        self._latest: deque[float] = deque(maxlen=IN_MIND)
        self._sorted: list[float] = []

    def __len__(self) -> int:
        return len(self._latest)

    def note(self, duration_s: float) -> None:
        """Add a duration, s."""
        if len(self._latest) == IN_MIND:
            del self._sorted[bisect_left(self._sorted, self._latest[0])]
        self._latest.append(duration_s)
        insort(self._sorted, duration_s)

    def within_s(self, share: float) -> float:
        """Return the shortest time (s) within which this share of them lies. Raises IndexError without any."""
        return self._sorted[int(share * (len(self._sorted) - 1))]


class UsualWait:
    """How long to wait for a device, by how long it usually takes: a lost byte costs little, a slow device is heard.

    Three times the usual time, at least `least_s` and at most `longest_s`. The wait is `longest_s` while too little is
    known, and for the next FEWEST answers of a device that shows that it has become slower.
    """

    def __init__(self, longest_s: float, least_s: float = MIN_WAIT_S) -> None:
        self._longest_s, self._least_s = longest_s, least_s
        self._durations = Durations()
        self._in_vain = 0
        self._patience = FEWEST  # answers until the usual time counts

    @property
    def wait_s(self) -> float:
        """How long to wait now, s."""
        if self._patience:
            return self._longest_s
        return min(self._longest_s, max(self._least_s, TIMES_USUAL * self._durations.within_s(USUAL_SHARE)))

    def took(self, duration_s: float) -> None:
        """Note that it came after `duration_s`, s."""
        self._in_vain, self._patience = 0, max(0, self._patience - 1)
        self._durations.note(max(0.0, duration_s))

    def missed(self) -> None:
        """Note that it did not come within `wait_s`."""
        self._in_vain += 1
        if self._in_vain >= MAX_IN_VAIN:
            self._patience = FEWEST

    def came_late(self) -> None:
        """Note that bytes came when they were not waited for any more."""
        if self._in_vain:
            self._patience = FEWEST
