"""The setpoints that a client has read, and which of them may still be used."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from compd.client_connection import Message
from compd.setpoint_states import state_named

# Clocks of two computers run apart by less than this, s per s: quartz by 1e-4, while NTP slews one by 5e-4.
CLOCK_DRIFT = 1e-3


class _ReadSetpoint(NamedTuple):
    """A SETPOINT message, and until when it may be used, s of this computer's monotonic clock."""

    message: Message
    until_s: float


class ReadSetpoints:
    """Setpoints in the order in which they came, until they are used."""

    def __init__(self, same_clock: bool, clock: Callable[[], float] = time.monotonic) -> None:
        """`same_clock`: the daemon's times are those of `clock`, as over its Unix socket."""
        self._same_clock = same_clock
        self._clock = clock
        self._waiting: deque[_ReadSetpoint] = deque()
        self._least_delay_s = math.inf
        self._put_s = -math.inf

    def __bool__(self) -> bool:
        """Whether one waits."""
        return bool(self._waiting)

    def put(self, message: Message) -> None:
        """Take a SETPOINT message that has just been read. One in a state that is not known becomes invalid."""
        if state_named(message.get("state", "")) is None:
            message["valid"] = False
        until_s: float = message.get("valid_until", -math.inf)
        if not self._same_clock:
            until_s += self._offset_s(message.get("time_s", math.nan))
        self._waiting.append(_ReadSetpoint(message, until_s))

    def next(self) -> Message:
        """The one that has waited longest. Raises IndexError where none waits."""
        return self._waiting.popleft().message

    def newest(self) -> Message | None:
        """The newest one, and forget all; None where there is none, or it is valid and must not be used any more."""
        if not self._waiting:
            return None
        message, until_s = self._waiting[-1]
        self._waiting.clear()
        return message if not message["valid"] or self._clock() < until_s else None

    def _offset_s(self, time_s: float) -> float:
        """This computer's clock less the daemon's, s.

        The message that came soonest after it was made tells it: one that waited on its way is older than its arrival.
        """
        now_s = self._clock()
        drift_s = CLOCK_DRIFT * (now_s - self._put_s)
        self._least_delay_s = min(self._least_delay_s + drift_s, now_s - time_s)
        self._put_s = now_s
        return self._least_delay_s
