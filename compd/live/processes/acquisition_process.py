"""What a process of the acquisition does: poll its lines, and tell how they are doing."""

from __future__ import annotations

import os
import threading
import traceback
from collections.abc import Callable, Mapping
from typing import Any

from compd.clock import Clock
from compd.live.acquisition import LOOK_EVERY_S, Acquisition
from compd.live.memory import Control, Phase, SharedMessage
from compd.live.system import MAX_SHARE, OUT_OF_MEMORY, RationedPriority, limit_memory

# Longest time (s) for a driver to release its line in the middle of a poll.
_STOP_WITHIN_S = 0.5
# Processor time of a line that polls as fast as it goes, with a margin: 115200 baud takes 0.04 (benchmarks/).
_SHARE_OF_A_FAST_LINE = 0.1
_STATUS_BYTES = 1024 * 1024


class AcquisitionProcess:
    """One process that polls some of the machine's lines."""

    def __init__(
        self,
        name: str,
        make: Callable[[], Acquisition],
        control: Control,
        clock: Clock,
        memory_mb: float,
        priority: int,
        look: Callable[[float], None] = lambda now_s: None,
    ) -> None:
        """`make`: the acquisition of its lines; `memory_mb`: by how much the process may grow, MB.

        `priority`: real-time priority of the lines' threads, below the loop's and the service's; 0 for none. `look`:
        called with the time (s) every `LOOK_EVERY_S`, for the votes of the gauges.
        """
        self.name = name  #: "acquisition", or "line" with the name of a line that has a process of its own
        self._make = make
        self._control = control
        self._clock = clock
        self._memory_mb = memory_mb
        self._look = look
        self._priority = priority
        self._status = SharedMessage(_STATUS_BYTES)

    @property
    def beats(self) -> int:
        """Grows as long as the process lives."""
        return self._status.version

    def status(self) -> Mapping[str, Any]:
        """How the lines are doing, a tenth of a second ago."""
        status: Mapping[str, Any] = self._status.read() or {}
        return status

    def run(self) -> None:
        """Poll until the daemon stops."""
        threading.excepthook = _end_with_thread
        acquisition = self._make()
        acquisition.start()
        limit_memory(self._memory_mb)
        priorities = self._priorities(acquisition)
        never = threading.Event()
        while self._control.phase != Phase.STOPPING:
            for priority in priorities:
                priority.look()
            self._status.write(dict(acquisition.status()))
            self._look(self._clock.monotonic())
            self._clock.wait(never, LOOK_EVERY_S)
        acquisition.stop(_STOP_WITHIN_S)

    def _priorities(self, acquisition: Acquisition) -> list[RationedPriority]:
        """Of this thread and of every line's. This one looks after the others: a driver that never waits loses its."""
        threads = [line.thread_id for line in acquisition.lines.values()]
        share = max(MAX_SHARE / max(1, len(threads)), _SHARE_OF_A_FAST_LINE)
        own = RationedPriority(self._priority, self._clock)
        return [own, *(RationedPriority(self._priority, self._clock, thread, share) for thread in threads)]


def _end_with_thread(arguments: threading.ExceptHookArgs) -> None:
    """End the process with a thread of it: a line without its thread would be stale for ever."""
    if isinstance(arguments.exc_value, MemoryError):
        os._exit(OUT_OF_MEMORY)
    traceback.print_exception(arguments.exc_value)
    os._exit(1)
