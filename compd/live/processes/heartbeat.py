"""Whether a process still beats, and when one that has ended is started anew."""

from __future__ import annotations

import math

_FIRST_WAIT_S = 0.1
_MAX_WAIT_S = 5.0
# Looks that a process may take until its first beat.
_STARTS_WITHIN = 100
# Time (s) after which a running process has recovered.
_RECOVERED_S = 10.0


class Heartbeat:
    """Counts looks without a beat.

    Looks and not seconds, so that nothing is killed where the whole daemon was stopped for a while.
    """

    def __init__(self, hung_after: int) -> None:
        """`hung_after`: looks without a beat after which the process hangs."""
        self._hung_after = hung_after
        self._beats = 0
        self._without = 0
        self._starting = True

    @property
    def is_late(self) -> bool:
        """Whether the last look found no beat."""
        return self._without > 0

    @property
    def hangs(self) -> bool:
        """Whether the last looks found no beat."""
        return self._without >= (_STARTS_WITHIN if self._starting else self._hung_after)

    def look(self, beats: int) -> bool:
        """Whether there was a beat since the last look. beats : how many there have ever been."""
        if beats != self._beats:
            self._beats, self._without, self._starting = beats, 0, False
            return True
        self._without += 1
        return False

    def excuse(self) -> None:
        """Begin to count anew: a debugger holds the process."""
        self._without = 0

    def reset(self) -> None:
        """Begin to count anew: the process is another one, which has yet to start."""
        self._without, self._starting = 0, True


class RestartDelay:
    """When a process that has ended is started anew: at once the first time, then after waits that double."""

    def __init__(self) -> None:
        self.due_s = math.inf  #: monotonic time (s) of the next start; inf while nothing waits for one
        self.failures = 0  #: how often in a row it has ended soon after its start

    def ended(self, started_s: float, now_s: float) -> None:
        """The process that was started at `started_s` has ended at `now_s` (s)."""
        self.failures = self.failures + 1 if now_s - started_s < _RECOVERED_S else 1
        wait_s = 0.0 if self.failures == 1 else min(_FIRST_WAIT_S * 2 ** (self.failures - 2), _MAX_WAIT_S)
        self.due_s = now_s + wait_s

    def take(self, now_s: float) -> bool:
        """Whether the process is to be started now."""
        if now_s < self.due_s:
            return False
        self.due_s = math.inf
        return True
