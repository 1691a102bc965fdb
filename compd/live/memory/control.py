"""What the daemon's processes tell each other besides readings, setpoints and commands."""

from __future__ import annotations

import os
from collections.abc import Callable
from enum import IntEnum
from selectors import EVENT_READ, BaseSelector

from compd.documents import MAX_BYTES
from compd.live.memory.shared_array import shared_counters
from compd.live.memory.shared_message import SharedMessage

_TEXT_BYTES = 4096
# Beside the bytes of a model file: its name.
_USUAL_BYTES = 64 * 1024

_PHASE, _TURN, _SUCCESSOR, _SERVICE_BEAT = range(4)


class Phase(IntEnum):
    """Of the daemon's life. RUNNING, then HOLDING the correction for the clients to see, then STOPPING."""

    RUNNING = 0
    HOLDING = 1
    STOPPING = 2


class Control:
    """The phase of the daemon, whose turn the loop is, beats, and the switch of models.

    Loops are numbered. The one whose number is `turn` cycles. Another one that is ready to take over is `successor`:
    the loop that has the turn gives it between two ticks.
    """

    def __init__(self) -> None:
        self._words = shared_counters(4)
        self._ending = SharedMessage(_TEXT_BYTES)
        #: (monotonic time in s, text) of the last end of a loop, for the reason of a `stop`. Written by the supervisor.
        self.loop_fault = SharedMessage(_TEXT_BYTES)
        self.realtime = SharedMessage()  #: what the system granted to the loop. Written by the loop that has the turn.
        self.processes = SharedMessage()  #: STATUS's part about the processes. Written by the supervisor.
        #: one line about the machine's state, for the service manager. Written by the service.
        self.headline = SharedMessage(_TEXT_BYTES)
        #: (number, text of a model file or None, whether as the shadow, hash of a shadow to apply or ""). Written by
        #: the service.
        self.model_request = SharedMessage(MAX_BYTES + _USUAL_BYTES)
        #: (number, summary of the models, "") or (number, None, why not). Written by the successor; by the supervisor
        #: where that has ended.
        self.model_answer = SharedMessage()
        #: supervisor_woken, turn_given: event descriptors
        self.supervisor_woken = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self.turn_given = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)

    @property
    def phase(self) -> int:
        """See `Phase`; written by the supervisor alone."""
        return self._words[_PHASE]

    def enter(self, phase: Phase, reason: str) -> None:
        """Enter a phase, for the reason that clients are told."""
        self._ending.write(reason)
        self._words[_PHASE] = phase

    def ending(self) -> str:
        """Why the daemon is about to end; "" as long as it is not."""
        return self._ending.read() if self._words[_PHASE] else ""

    @property
    def turn(self) -> int:
        """Number of the loop that cycles."""
        return self._words[_TURN]

    def give_turn(self, loop: int) -> None:
        """Let this loop cycle; called by the loop that had the turn, or by the supervisor where that has ended."""
        self._words[_TURN] = loop
        self._words[_SUCCESSOR] = 0
        os.eventfd_write(self.turn_given, 1)

    @property
    def successor(self) -> int:
        """Number of the loop that is ready to take over; 0 where there is none."""
        return self._words[_SUCCESSOR]

    def await_turn(self, loop: int, timeout_s: float, selector: Callable[[], BaseSelector]) -> bool:
        """Offer to take over as this loop, and wait for the turn; False where it has not come."""
        self._words[_SUCCESSOR] = loop
        with selector() as waiting:
            waiting.register(self.turn_given, EVENT_READ)
            while self.turn != loop:
                if not waiting.select(timeout_s):
                    self.withdraw(loop)
                    return self.turn == loop
                os.eventfd_read(self.turn_given)
        return True

    def withdraw(self, loop: int) -> None:
        """Offer this loop no longer."""
        if self._words[_SUCCESSOR] == loop:
            self._words[_SUCCESSOR] = 0

    def keeps_turn(self, loop: int) -> bool:
        """Whether this loop is to go on; it gives the turn to its successor where there is one."""
        words = self._words
        if successor := words[_SUCCESSOR]:
            self.give_turn(successor)
        return words[_TURN] == loop and words[_PHASE] != Phase.STOPPING

    @property
    def service_beats(self) -> int:
        """How often the service's thread has gone round."""
        return self._words[_SERVICE_BEAT]

    def beat_service(self) -> None:
        """Count a round of the service's thread."""
        self._words[_SERVICE_BEAT] += 1

    def wake_supervisor(self) -> None:
        """Let the supervisor look at once."""
        os.eventfd_write(self.supervisor_woken, 1)

    def close(self) -> None:
        """Close the event descriptors."""
        os.close(self.supervisor_woken)
        os.close(self.turn_given)
