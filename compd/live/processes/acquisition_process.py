"""What a process of the acquisition does: poll its lines, and tell how they are doing."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from compd.live.acquisition import LOOK_EVERY_S, Acquisition
from compd.live.memory import Control, Phase, SharedMessage
from compd.live.system import MAX_SHARE, RationedPriority, System

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
        make: Callable[[], tuple[Acquisition, Callable[[float], None]]],
        control: Control,
        system: System,
        memory_mb: float,
        priority: int,
    ) -> None:
        """`make`: called in the process; the acquisition of its lines, and what looks at them every `LOOK_EVERY_S`,
        with the time (s): the votes of the gauges. `memory_mb`: by how much the process may grow, MB.

        `priority`: real-time priority of the lines' threads, below the loop's and the service's; 0 for none.
        """
        self.name = name  #: "acquisition", or "line" with the name of a line that has a process of its own
        self._make = make
        self._control = control
        self._system = system
        self._memory_mb = memory_mb
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
        privileges = self._system.privileges
        privileges.end_with_any_thread()
        acquisition, look = self._make()
        acquisition.start()
        privileges.limit_memory(self._memory_mb)
        priorities = self._priorities(acquisition)
        never = threading.Event()
        while self._control.phase != Phase.STOPPING:
            for priority in priorities:
                priority.look()
            self._status.write(dict(acquisition.status()))
            look(self._system.monotonic())
            self._system.wait(never, LOOK_EVERY_S)
        acquisition.stop(_STOP_WITHIN_S)

    def _priorities(self, acquisition: Acquisition) -> list[RationedPriority]:
        """Of this thread and of every line's. This one looks after the others: a driver that never waits loses its."""
        threads = [line.thread_id for line in acquisition.lines.values()]
        share = max(MAX_SHARE / max(1, len(threads)), _SHARE_OF_A_FAST_LINE)
        ration = partial(self._system.privileges.rationed_priority, self._priority, self._system)
        return [ration(), *(ration(thread, share) for thread in threads)]
