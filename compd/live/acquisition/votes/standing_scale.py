"""A scale that stands while all other links move is stuck, or its display shows something else."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from compd.arrays import FloatArray
from compd.live.acquisition.votes.machine_view import Contradiction, MachineView


class StandingScale:
    """Remembers, for each scale, what all showed when it began to stand."""

    def __init__(self, moved_mm: float) -> None:
        """`moved_mm`: by how much all others must have moved.

        On a straight way of s a link of length l perpendicular to it changes by s**2 / 2 l: by 4 um in 2 mm with
        l = 500 mm, more than a scale's noise.
        """
        self._moved_mm = moved_mm
        self._since: dict[int, FloatArray] = {}
        self._moved_s: dict[int, float] = {}  # when all others were seen to have moved so far

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        scales = view.of_kind("scale")
        for i in scales:
            since = self._since.get(i)
            if since is None or not view.believed[i] or abs(view.value[i] - since[i]) > view.memory.tolerance_mm[i]:
                self._since[i] = view.value.copy()
                self._moved_s.pop(i, None)
                continue
            others = [j for j in scales if j != i]
            moved_mm = np.abs(view.value[others] - since[others])
            if not (others and view.believed[others].all() and moved_mm.min() > self._moved_mm):
                self._moved_s.pop(i, None)
                continue
            # a scale that has not been read since then does not stand: nobody knows
            if view.memory.time_s[i] > self._moved_s.setdefault(i, view.now_s):
                del self._since[i]
                yield Contradiction(i, f"stands while all others have moved by {moved_mm.min():.1f} mm or more")
