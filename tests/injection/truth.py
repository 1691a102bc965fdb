"""The truth against which setpoints of a real daemon are held: asked for beside it, and remembered."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from compd.errors import DaemonError
from compd.simulation import ControlClient
from tests.support.patience import PATIENCE_S
from tests.support.watching import until

EVERY_S = 0.05
# Priority of what stands for devices.
PREFERRED = -10


class Asked(NamedTuple):
    """The truth between asking and the answer."""

    from_s: float
    to_s: float
    tip_mm: np.ndarray
    moving: bool


class Truth:
    """Asks the simulated machine for its true tip, twenty times a second, and remembers it."""

    def __init__(self, control: Path) -> None:
        self._client = ControlClient(control)
        self._lock = threading.Lock()
        self._end = threading.Event()
        self._seen: list[Asked] = []
        self._ask()
        self._thread = threading.Thread(target=self._run, name="truth", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._end.set()
        self._thread.join(PATIENCE_S)
        self._client.__exit__()

    def drive(self, scale_mm: Sequence[float]) -> None:
        """Drive there, and return when the machine has come to rest."""
        with self._lock:
            self._client.ask("DRIVE", scale_mm=list(scale_mm))
        until("the machine rests", lambda: not self._ask()["moving"])

    def rest_for(self, duration_s: float) -> None:
        """Let the machine stand for so long."""
        end_s = time.monotonic() + duration_s
        until("a rest", lambda: self._seen[-1].from_s > end_s)

    def tip_mm(self) -> list[float]:
        """The true tip as of the last answer."""
        tip_mm: list[float] = self._seen[-1].tip_mm.tolist()
        return tip_mm

    def at(self, from_s: float, to_s: float) -> np.ndarray | None:
        """(3,) the true tip, if the machine stood still from `from_s` to `to_s` and it is known; else None.

        The answers before and after count as well, so that no motion between two answers is missed.
        """
        seen = self._seen[:]
        first = bisect_right(seen, from_s, key=lambda asked: asked.to_s) - 1
        last = bisect_left(seen, to_s, key=lambda asked: asked.from_s)
        if first < 0 or last == len(seen) or any(asked.moving for asked in seen[first : last + 1]):
            return None
        return seen[last].tip_mm

    def _ask(self) -> dict[str, Any]:
        with self._lock:
            from_s = time.monotonic()
            truth = self._client.ask("TRUTH")
            self._seen.append(Asked(from_s, time.monotonic(), np.array(truth["tip_mm"]), truth["moving"]))
        return truth

    def _run(self) -> None:
        with contextlib.suppress(PermissionError):  # as an instrument, which no program slows down
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), PREFERRED)
        with contextlib.suppress(OSError, ValueError, DaemonError):  # the machine has been stopped
            while not self._end.wait(EVERY_S):
                self._ask()
