"""The truth against which setpoints are held: asked for beside the daemon, and remembered."""

from __future__ import annotations

import contextlib
import math
import os
import threading
import time
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from compd.errors import DaemonError
from compd.simulation import ControlClient
from tests.support.patience import PATIENCE_S
from tests.support.watching import until

# For so long after a motion a setpoint may rest on readings from the motion: two polls of the slowest gauge.
SETTLED_S = 0.3
REST_EVERY_S = 0.05
# In motion: with links at 250 mm/s2 the way between two answers is known to some um.
MOTION_EVERY_S = 0.01
# Where two answers are further apart nobody knows the way between them; no motion and its way back are this short.
MOVING_GAP_S = 0.03
RESTING_GAP_S = 0.3
# Priority of what stands for devices.
PREFERRED = -10
# How far links go in a drive away, mm; from further out than TURNS_MM, back.
WAY_MM, TURNS_MM = 7.0, 7.5
# Between two motions of a machine that measures.
DWELL_S = 0.15


class Asked(NamedTuple):
    """The truth as of `time_s`, between asking and the answer."""

    from_s: float
    to_s: float
    tip_mm: np.ndarray
    moving: bool
    time_s: float


class Truth:
    """Asks the simulated machine for its true tip, twenty times a second or as often as is said, and remembers it."""

    def __init__(self, control: Path, every_s: float = REST_EVERY_S) -> None:
        self._client = ControlClient(control)
        self._lock = threading.Lock()
        self._end = threading.Event()
        self._seen: list[Asked] = []
        self._every_s = every_s
        self._place_mm: Sequence[float] = ()
        self._places: Iterator[Sequence[float]] | None = None
        self._stands_since_s = -math.inf
        self._ask()
        self._thread = threading.Thread(target=self._run, name="truth", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._end.set()
        self._thread.join(PATIENCE_S)
        self._client.__exit__()

    def forget(self) -> None:
        """All but the last second."""
        del self._seen[: -round(1 / self._every_s)]

    def drive(self, scale_mm: Sequence[float], patience_s: float = PATIENCE_S) -> None:
        """Drive there, and return when the machine has come to rest and every gauge has been read again."""
        with self._lock:
            self._client.ask("DRIVE", scale_mm=list(scale_mm))
        self._place_mm = tuple(scale_mm)
        until("the machine rests", lambda: not self._ask()["moving"], patience_s)
        self.rest_for(SETTLED_S)

    def drive_away(self) -> None:
        """Drive so that every link goes the same way: less far, a scale that is stuck cannot be told."""
        self.drive([mm + WAY_MM if mm < TURNS_MM else mm - WAY_MM for mm in self._place_mm])

    @contextmanager
    def shuttling(self, places_mm: Sequence[Sequence[float]]) -> Iterator[None]:
        """During the block the machine drives from one place to the next, with a short dwell at each."""
        self._places = cycle(places_mm)
        try:
            yield
        finally:
            self._places = None

    def wait_for_motion(self) -> None:
        """Until the machine has left its rest, and every gauge has been read since."""
        until("the machine moves", lambda: self._seen[-1].moving)
        self.rest_for(SETTLED_S)

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

    def tips_mm(self, times_s: Sequence[float]) -> np.ndarray:
        """(k, 3) the true tip at these times, in motion and at rest; nan where the machine was not asked near them."""
        seen = self._seen[:]
        asked_s = np.array([asked.time_s for asked in seen])
        wanted_s = np.asarray(times_s, dtype=float)
        after = np.searchsorted(asked_s, wanted_s).clip(1, len(seen) - 1)
        moved = np.array([asked.moving for asked in seen])
        gap_s = asked_s[after] - asked_s[after - 1]
        rested = ~(moved[after] | moved[after - 1]) & (gap_s <= RESTING_GAP_S)
        known = (asked_s[0] <= wanted_s) & (wanted_s <= asked_s[-1]) & ((gap_s <= MOVING_GAP_S) | rested)
        tips_mm = PchipInterpolator(asked_s, np.array([asked.tip_mm for asked in seen]))(wanted_s)
        return np.where(known[:, None], tips_mm, np.nan)

    def _ask(self) -> dict[str, Any]:
        with self._lock:
            from_s = time.monotonic()
            truth = self._client.ask("TRUTH")
            tip_mm, asked_s = np.array(truth["tip_mm"]), truth["monotonic_s"]
            self._seen.append(Asked(from_s, time.monotonic(), tip_mm, truth["moving"], asked_s))
        return truth

    def _run(self) -> None:
        with contextlib.suppress(PermissionError):  # as an instrument, which no program slows down
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), PREFERRED)
        with contextlib.suppress(OSError, ValueError, DaemonError):  # the machine has been stopped
            while not self._end.wait(self._every_s):
                self._shuttle(moving=self._ask()["moving"])

    def _shuttle(self, moving: bool) -> None:
        places, now_s = self._places, time.monotonic()
        if moving or places is None:
            self._stands_since_s = now_s
        elif now_s > self._stands_since_s + DWELL_S:
            with self._lock:
                self._client.ask("DRIVE", scale_mm=list(next(places)))
