"""The processes of the loop: the one that has the turn, one that is to take over, and those that have given it up."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import structlog

from compd.live.processes import LoopProcess, ModelChange
from compd.live.system import ChildProcess, System

# For reading a model file and trying it; imports of an effect's author may take seconds.
READY_WITHIN_S = 15.0

_log = structlog.get_logger()


class LoopSuccession:
    """Starts loops, and knows which of them is the daemon's; used by the supervisor."""

    def __init__(self, process: LoopProcess, system: System, output: int | None) -> None:
        """`output`: where the loops' log goes."""
        self._process = process
        self._control = process.control
        self._system = system
        self._output = output
        self._number = 0
        self._starts = 0
        self._last_end = ""
        self.loop = self._child("loop", lambda: None)  #: the one that has the turn
        self._successor: ChildProcess | None = None
        self._successor_number = 0
        self._retired: list[ChildProcess] = []

    @property
    def children(self) -> list[ChildProcess]:
        """Every process of a loop."""
        successors = [] if self._successor is None else [self._successor]
        return [self.loop, *successors, *self._retired]

    @property
    def has_successor(self) -> bool:
        """Whether a loop is getting ready to take over."""
        return self._successor is not None

    def summary(self) -> dict[str, Any]:
        """For STATUS: how many loops there were, and how the last one ended that did not give the turn."""
        return {"starts": self._starts} | ({"last_end": self._last_end} if self._last_end else {})

    def start(self, forget: bool = False) -> None:
        """Start the first loop, or another one after it has ended.

        A successor that is ready gets the turn instead. forget : begin anew but for the correction that is applied.
        """
        if self._control.successor:
            self._control.give_turn(self._control.successor)
            return
        number = self._next_number()
        self.loop = self._child("loop", lambda: self._process.run(number, forget))
        self._control.give_turn(number)
        self._starts += 1
        self.loop.start()

    def start_successor(self, request: ModelChange) -> None:
        """Start a loop that takes over as soon as it is ready with the model that is asked for."""
        number = self._successor_number = self._next_number()
        self._successor = self._child("next loop", lambda: self._process.run_successor(number, request))
        self._successor.start()

    def end_late_successor(self, now_s: float) -> None:
        """Kill a successor that is not ready in time: an effect of a user's own may loop for ever."""
        successor = self._successor
        if successor is None or not successor.running or now_s - successor.started_s <= READY_WITHIN_S:
            return
        if self._control.successor != self._successor_number and not successor.is_debugged:
            successor.kill(f"it was not ready within {READY_WITHIN_S:g} s, and was killed")

    def turn_has_changed(self) -> bool:
        """Whether the successor has taken over since the last call."""
        if self._successor is None or self._control.turn != self._successor_number:
            return False
        self._retired.append(self.loop)
        self.loop, self._successor = self._successor, None
        self._starts += 1
        return True

    def collect(self, request: int) -> bool:
        """Note which processes have ended; whether the loop is among them.

        request : number of the request for which the successor was started. It is refused where that one has ended.
        """
        self.turn_has_changed()
        self._retired = [child for child in self._retired if not child.collect()]
        successor = self._successor
        if successor is not None and successor.collect():
            self._successor = None
            self._control.withdraw(self._successor_number)
            self._refuse_unless_answered(request, successor)
        if self.loop.running and self.loop.collect():
            self._last_end = self.loop.last_end
            if self._successor is None:  # it may have had the turn, and not yet answered
                self._refuse_unless_answered(request, self.loop)
            return True
        return False

    def _refuse_unless_answered(self, request: int, ended: ChildProcess) -> None:
        """Answer a request in the place of the loop that was to use the model and has ended."""
        answer = self._control.model_answer.read()
        if request and (answer is None or answer[0] != request):
            why = f"the loop that was to use it has ended: {ended.last_end}"
            _log.error("model refused", reason=why)
            self._process.answer(request, None, why)

    def _next_number(self) -> int:
        self._number += 1
        return self._number

    def _child(self, name: str, run: Callable[[], None]) -> ChildProcess:
        return ChildProcess(name, run, self._system, self._output, keeps_sockets=False)
