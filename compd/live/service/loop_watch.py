"""Tells when the loop makes no setpoints, and makes the one that says so in its place."""

from __future__ import annotations

import math
from collections.abc import Callable

from compd.live.loop import Setpoint
from compd.live.memory import SharedRing
from compd.setpoint_states import Mode, State

# Within two periods, and not sooner than 20 ms, clients are told that there is no setpoint. A part of that time is left
# for the way to them.
_MIN_LIMIT_S = 0.02
_PERIODS = 2
_SHARE = 0.8
_REPEAT_EVERY_S = 0.1
# The first loop starts with the daemon.
_FIRST_WITHIN_S = 5.0
# Of `time_s` in a setpoint's line. Two processes that go on after a pause read their clocks within less.
_RESOLUTION_S = 1e-6


class LoopWatch:
    """Looks after the loop on behalf of the clients; used by the publisher's thread.

    A setpoint without a loop has the next number after the last one. A loop that comes too late with that number has
    missed it.
    """

    def __init__(
        self, ring: SharedRing, period_s: float, fault: Callable[[], tuple[float, str] | None], start_s: float
    ) -> None:
        """`fault`: monotonic time (s) and reason of the last end of a loop; `start_s`: when the watch begins."""
        self.limit_s = _SHARE * max(_PERIODS * period_s, _MIN_LIMIT_S)
        self._ring = ring
        self._fault = fault
        self._start_s = start_s
        self._repeat_every_s = max(_REPEAT_EVERY_S, period_s)
        self._next_s = -math.inf
        self._count = 0
        self._seq = 0
        self._stop_s = -math.inf

    def admits(self, seq: int, time_s: float) -> bool:
        """Whether a setpoint of the loop, with this number and time (s), may still be published.

        Clients rely on number and time that grow from line to line.
        """
        if seq <= self._seq or time_s - self._stop_s <= _RESOLUTION_S:
            return False
        self._seq = seq
        return True

    def wait_s(self, now_s: float) -> float:
        """How long to wait, at most, before asking `missing` again, s."""
        count = self._ring.count
        last_s = self._ring.when(count - 1)[0] if count else self._start_s
        left_s = last_s + self.limit_s - now_s
        return left_s if left_s > 0 else self.limit_s

    def missing(self, now_s: float) -> Setpoint | None:
        """The `stop` to publish at `now_s`, where the loop has made no setpoint for `limit_s`; None otherwise."""
        count = self._ring.count
        if count != self._count:
            self._count, self._next_s = count, -math.inf
        last_s, limit_s = (self._ring.when(count - 1)[0], self.limit_s) if count else (self._start_s, _FIRST_WITHIN_S)
        if now_s - last_s < limit_s or now_s < self._next_s:
            return None
        self._next_s = now_s + self._repeat_every_s
        reason = f"the loop has made no setpoint for {now_s - last_s:.3f} s"
        if (fault := self._fault()) is not None and fault[0] >= last_s:
            reason += f"; {fault[1]}"
        return self.stop(now_s, reason)

    def stop(self, now_s: float, reason: str) -> Setpoint:
        """A `stop` that the loop has not made."""
        self._seq += 1
        self._stop_s = now_s
        return Setpoint(self._seq, now_s, now_s, math.nan, State.STOP, reason, Mode.CMM, None)
