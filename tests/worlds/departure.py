"""Motion that no reading shows yet: a machine that has left its place, or whose links change their speed impossibly.

Of each scale by itself: its newest reading was sampled before, and the next one is not overdue. One that is overdue
counts as standing while other scales answer, and none of them shows a departure either. By docs/explanation/
limits-and-stale-gauges.md `u_tip_um` leaves a departure out after a long rest, and no other.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from compd.arrays import FloatArray

# A rest is long that has lasted so many times as long as a reading is old.
RESTED = 19.0


class Departure:
    """Follows the true motion of a world's scales; called with every setpoint.

    shows_mm (n,) : a change that a reading shows. acceleration (n,) : what is stated, mm/s2; inf where nothing is.
    """

    def __init__(self, shows_mm: FloatArray, acceleration: FloatArray) -> None:
        self._shows_mm, self._acceleration = shows_mm, acceleration
        count = len(shows_mm)
        self._now_s = self._left_s = math.inf
        self._since_s = math.inf  # of the rest
        self._still_s = math.inf  # of the newest standstill
        self._rest_mm = self._before_mm = np.full(count, math.nan)
        self._speeds = np.full(count, math.nan)
        self._broke_s = np.full(count, -math.inf)

    def unseen(
        self,
        now_s: float,
        moving: bool,
        true_mm: FloatArray,
        speeds: FloatArray,
        read_s: FloatArray,
        sampled_mm: Callable[[], FloatArray],
        due_s: FloatArray,
    ) -> np.ndarray:
        """Whether a scale (n,) has moved since its newest reading in a way that nobody can know of yet.

        true_mm, speeds : (n,) now, mm/s. read_s : (n,) of the newest readings. sampled_mm : (n,) truth when they were
        sampled. due_s : (n,) from a reading to the time from which the next one is overdue.
        """
        self._follow_speeds(now_s, speeds)
        self._follow_rest(now_s, moving, true_mm)
        age_s = now_s - read_s
        awaited = age_s <= due_s
        unseen = awaited & (read_s < self._broke_s)
        if self._left_s < math.inf:
            rested = self._left_s - self._since_s >= RESTED * age_s
            sampled = sampled_mm()
            at_rest = np.abs(sampled - self._rest_mm) <= self._shows_mm
            stands = awaited | (awaited.any() & at_rest.all())
            unseen |= stands & rested & at_rest
            if not moving and (np.abs(sampled - true_mm) <= self._shows_mm).all():
                self._left_s, self._since_s, self._rest_mm = math.inf, self._still_s, true_mm.copy()
        return unseen

    def _follow_speeds(self, now_s: float, speeds: FloatArray) -> None:
        """Note where the speed has changed by more than is stated."""
        possible = self._acceleration * (now_s - self._now_s) + 1e-6 if self._now_s < math.inf else math.inf
        self._broke_s = np.where(np.abs(speeds - self._speeds) > possible, now_s, self._broke_s)
        self._speeds = speeds

    def _follow_rest(self, now_s: float, moving: bool, true_mm: FloatArray) -> None:
        if moving or not (np.abs(true_mm - self._before_mm) <= self._shows_mm).all():
            self._still_s = now_s
        if self._now_s == math.inf:
            self._since_s, self._rest_mm = now_s if moving else -math.inf, true_mm.copy()  # a world begins at rest
        elif self._left_s == math.inf and (moving or not (np.abs(true_mm - self._rest_mm) <= self._shows_mm).all()):
            self._left_s = self._now_s
        self._now_s, self._before_mm = now_s, true_mm.copy()
