"""How long the computer itself pauses during a test: no program on it can keep time then."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial

from compd.live.memory import shared_floats
from compd.live.system import sleep_until
from tests.support.other_process import beside

_STEP_S = 0.01
# Later than this, with the highest priority, is no matter of the processor's other work.
_PAUSE_S = 0.01
_PRIORITY = 90
# From so much on, s, in one test, gauges on a machine that is simulated beside may be too late for the daemon.
MATTERS_S = 0.05
# Without a pause for so long, s, the computer is quiet again; a neighbour's work goes on for minutes.
_QUIET_S = 5.0
_SETTLES_IN_S = 90.0


class Pauses:
    """A process of the highest priority on every processor, which sleeps and looks how late it wakes.

    Attributes
    ----------
    lost_s : sum of the pauses so far, of the processor that paused longest, s.
    """

    def __init__(self) -> None:
        self._processors = sorted(os.sched_getaffinity(0))
        self._lost_s = shared_floats(len(self._processors))

    @property
    def lost_s(self) -> float:
        return float(self._lost_s.max())

    def settle(self) -> None:
        """Wait until the computer runs without a pause for a while; not for ever."""
        end_s = time.monotonic() + _SETTLES_IN_S
        while time.monotonic() < end_s:
            before_s = self.lost_s
            sleep_until(time.monotonic() + _QUIET_S)
            if self.lost_s == before_s:
                return

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Look until the block ends."""
        with ExitStack() as watchers:
            for i, processor in enumerate(self._processors):
                watchers.enter_context(beside(partial(self._look, i, processor)))
            yield

    def _look(self, i: int, processor: int) -> None:
        os.sched_setaffinity(0, {processor})
        with suppress(OSError):  # where priority is not permitted, pauses look longer than they are
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
        while True:
            wake_s = time.monotonic() + _STEP_S
            sleep_until(wake_s)
            late_s = time.monotonic() - wake_s
            if late_s > _PAUSE_S:
                self._lost_s[i] += late_s
