"""How long the computer itself pauses during a test: no program on it can keep time then."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from compd.live.memory.shared_array import shared_floats
from compd.live.realtime import sleep_until
from tests.support.other_process import beside

_STEP_S = 0.005
# Later than this, with the highest priority, is no matter of the processor's other work.
_PAUSE_S = 0.01
_PRIORITY = 90
# From so much on, s, in one try, gauges on a machine that is simulated beside may be too late for the daemon.
_MATTERS_S = 0.05
_TRIES = 3


class Pauses:
    """A process of the highest priority, which sleeps and looks how late it wakes.

    Attributes
    ----------
    lost_s : sum of its pauses so far, s.
    """

    def __init__(self) -> None:
        self._lost_s = shared_floats(1)

    @property
    def lost_s(self) -> float:
        return float(self._lost_s[0])

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Look until the block ends."""
        with beside(self._look):
            yield

    def _look(self) -> None:
        with suppress(OSError):  # where priority is not permitted, pauses look longer than they are
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
        wake_s = time.monotonic() + _STEP_S
        sleep_until(wake_s)
        late_s = time.monotonic() - wake_s
        if late_s > _PAUSE_S:
            self._lost_s[0] += late_s


def again_after_a_pause(run: Callable[[], None]) -> None:
    """Call `run`, and once more where it fails while the computer itself has paused; three times at most.

    What runs a simulated machine beside its daemon in real time loses the gauges while neither runs, and the daemon
    does not believe them afterwards. Without a pause, the first failure counts.
    """
    pauses = Pauses()
    with pauses.watched():
        for tries_left in reversed(range(_TRIES)):
            before_s = pauses.lost_s
            try:
                run()
                return
            except Exception as error:
                paused_s = pauses.lost_s - before_s
                if paused_s < _MATTERS_S or not tries_left:
                    raise
                print(f"--- tried again, as the computer itself paused for {paused_s:.2f} s meanwhile: {error}")
