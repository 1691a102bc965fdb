"""A scale is stuck, or its display shows something else, if it stands while all other links depart from rest.

A link that arrives before the others stands, too, while they still move: it has moved before. A scale that gets stuck
on the way stops faster than the machine can; the limits of its acceleration show that. One that gets stuck just after
its departure looks like a link that had hardly any way to go: it is suspected, and has no value, until its digits
change.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from compd.arrays import FloatArray
from compd.live.acquisition.cross_checks.machine_view import Contradiction, MachineView

# Largest motion (mm) of a scale that got stuck before its acceleration showed: two readings 25 ms apart leave open 8
# mm/s, reached with 300 mm/s2.
_HARDLY_MM = 0.1
# Equal readings that are no chance: less than 5e-4 if a reading differs from the one before with a probability of at
# least 0.62 (`repeated_digits`).
_REPEATS = 8


class StandingScale:
    """Remembers the scales' values when all of them stood, and which have stood since."""

    def __init__(self, moved_mm: float) -> None:
        """`moved_mm`: least motion of all others.

        On a straight way of s a link of length l perpendicular to it changes by s**2 / 2 l: by 4 um in 2 mm with
        l = 500 mm, more than a scale's noise.
        """
        self._moved_mm = moved_mm
        self._last: tuple[FloatArray, FloatArray] | None = None  # values at the last look, and the times of reading
        self._at_rest: FloatArray | None = None  # and when all of them last stood
        self._standing: set[int] = set()
        self._moved_s: dict[int, float] = {}  # time at which all others had moved that far
        self._suspects: dict[int, tuple[float, float]] = {}  # changes of its digits; motion of the others (mm)

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        yield from self._look_at_suspects(view)
        scales = view.of_kind("scale")
        n = len(view.wired)
        last, self._last = self._last, (view.value.copy(), view.memory.time_s[:n].copy())
        if last is None or not view.believed[scales].all():
            self._at_rest = None
            return
        tolerance_mm = view.memory.tolerance_mm[:n]
        # a scale without a reading since then may have moved
        stands = (np.abs(view.value - last[0]) <= tolerance_mm) & (view.memory.time_s[:n] > last[1])
        if stands[scales].all():
            self._at_rest, self._standing = view.value.copy(), set(scales)
            self._moved_s.clear()
        if self._at_rest is None:
            return
        way_mm = np.abs(view.value - self._at_rest)
        self._standing = {i for i in self._standing if way_mm[i] <= self._reach_mm(view, i)}
        for i in sorted(self._standing):
            others_mm = way_mm[[j for j in scales if j != i]]
            # a scale without a reading since their motion does not count as standing
            if not len(others_mm) or others_mm.min() <= self._moved_mm:
                continue
            if view.memory.time_s[i] <= self._moved_s.setdefault(i, view.now_s):
                continue
            self._standing.remove(i)
            if way_mm[i] <= tolerance_mm[i]:
                yield _contradiction(i, others_mm.min())
                return
            self._suspects[i] = float(view.memory.changes[i]), float(others_mm.min())
            view.memory.suspected[i] = True

    def _look_at_suspects(self, view: MachineView) -> Iterator[Contradiction]:
        memory = view.memory
        for i, (changes, others_mm) in list(self._suspects.items()):
            if memory.changes[i] == changes and memory.repeats[i] < _REPEATS and view.believed[i]:
                continue
            del self._suspects[i]
            if memory.changes[i] == changes and view.believed[i]:
                yield _contradiction(i, others_mm)
            memory.suspected[i] = False

    def _reach_mm(self, view: MachineView, i: int) -> float:
        """Largest motion (mm) of a standing scale; larger if its digits show whether it is live."""
        tolerance_mm = float(view.memory.tolerance_mm[i])
        scatters = view.wired[i].noise >= view.memory.step_mm[i]
        return max(tolerance_mm, _HARDLY_MM) if scatters else tolerance_mm


def _contradiction(i: int, others_mm: float) -> Contradiction:
    return Contradiction(i, f"stands while all others have moved by {others_mm:.1f} mm or more")
