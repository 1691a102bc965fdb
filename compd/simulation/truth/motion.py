"""Motion of the links: a tour from point to point, or along a controller's scale setpoints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from compd.arrays import FloatArray

Phase = Literal["moving", "dwelling"]

# Drives of a measuring machine.
SPEED_MM_PER_S = 50.0
ACCELERATION_MM_PER_S2 = 250.0
# Longest step in which a controller's setpoints are followed.
FOLLOWING_STEP_S = 0.004


@dataclass(frozen=True)
class Move:
    """Synchronous motion of all links from `start_mm` to `end_mm`, (n,) each, with a trapezoidal speed profile.

    speed_mm_per_s : limit for the link that has the longest way; the others move in proportion.
    """

    start_mm: FloatArray
    end_mm: FloatArray
    speed_mm_per_s: float = SPEED_MM_PER_S

    @property
    def _way_mm(self) -> float:
        return float(np.abs(self.end_mm - self.start_mm).max())

    @property
    def _ramp_s(self) -> float:
        return min(self.speed_mm_per_s / ACCELERATION_MM_PER_S2, math.sqrt(self._way_mm / ACCELERATION_MM_PER_S2))

    @property
    def duration_s(self) -> float:
        ramp_s = self._ramp_s
        return ramp_s + self._way_mm / (ACCELERATION_MM_PER_S2 * ramp_s) if ramp_s > 0 else 0.0

    def position_mm(self, time_s: float) -> FloatArray:
        """(n,) scale positions `time_s` after the start; `end_mm` after the end."""
        duration_s, ramp_s = self.duration_s, self._ramp_s
        if time_s >= duration_s:
            return self.end_mm
        if time_s < ramp_s:
            way = 0.5 * ACCELERATION_MM_PER_S2 * time_s**2
        elif time_s > duration_s - ramp_s:
            way = self._way_mm - 0.5 * ACCELERATION_MM_PER_S2 * (duration_s - time_s) ** 2
        else:
            way = ACCELERATION_MM_PER_S2 * ramp_s * (time_s - ramp_s / 2)
        return self.start_mm + (way / self._way_mm) * (self.end_mm - self.start_mm)


class TourMotion:
    """Endless tour of points in random order, with a dwell at each."""

    def __init__(self, start_mm: FloatArray, points_mm: FloatArray, dwell_s: float, rng: np.random.Generator) -> None:
        """start_mm : (n,). points_mm : (points, n) scale values."""
        self._points_mm = points_mm
        self._dwell_s = dwell_s
        self._rng = rng
        self.point = 0
        self._since_s = 0.0
        self._move = Move(start_mm, start_mm)
        self._depart(start_mm)

    @property
    def phase(self) -> Phase:
        return "moving" if self._since_s < self._move.duration_s else "dwelling"

    @property
    def position_mm(self) -> FloatArray:
        return self._move.position_mm(self._since_s)

    def advance(self, time_s: float) -> float:
        """Advance by `time_s`; returns how many seconds of it the links moved."""
        moved_s = 0.0
        while True:
            left_s = self._move.duration_s + self._dwell_s - self._since_s
            step_s = min(time_s, left_s)
            moved_s += min(step_s, max(0.0, self._move.duration_s - self._since_s))
            self._since_s += step_s
            if time_s < left_s:
                return moved_s
            time_s -= step_s
            self._depart(self._move.end_mm)

    def _depart(self, start_mm: FloatArray) -> None:
        others = [i for i in range(1, len(self._points_mm) + 1) if i != self.point]
        self.point = int(self._rng.choice(others))
        self._move = Move(start_mm, self._points_mm[self.point - 1])
        self._since_s = 0.0


class SetpointMotion:
    """Motion of each link to its own setpoint within limits of speed and acceleration, without overshoot."""

    point = None

    def __init__(self, start_mm: FloatArray) -> None:
        self.position_mm = start_mm
        self.setpoint_mm = start_mm
        self._speed_mm_per_s = np.zeros_like(start_mm)

    @property
    def phase(self) -> Phase:
        return "dwelling" if np.array_equal(self.position_mm, self.setpoint_mm) else "moving"

    def advance(self, time_s: float) -> float:
        """Advance by `time_s`; returns how many seconds of it the links moved."""
        moved_s = 0.0
        while time_s - moved_s > 1e-12 and self.phase == "moving":
            step_s = min(FOLLOWING_STEP_S, time_s - moved_s)
            self._step(step_s)
            moved_s += step_s
        return moved_s

    def _step(self, step_s: float) -> None:
        left_mm = self.setpoint_mm - self.position_mm
        gain = ACCELERATION_MM_PER_S2 * step_s
        # highest speed from which the link can still brake within `left_mm`, after one more step of travel
        braking = np.sqrt(gain**2 / 4 + 2 * ACCELERATION_MM_PER_S2 * np.abs(left_mm)) - gain / 2
        wanted = np.sign(left_mm) * np.minimum(braking, SPEED_MM_PER_S)
        self._speed_mm_per_s = self._speed_mm_per_s + np.clip(wanted - self._speed_mm_per_s, -gain, gain)
        travel_mm = self._speed_mm_per_s * step_s
        # after a short step the next one may have more speed to take off than it can: stop at the setpoint
        slow = np.abs(self._speed_mm_per_s) <= 2 * ACCELERATION_MM_PER_S2 * FOLLOWING_STEP_S
        arrived = (np.abs(left_mm) <= np.abs(travel_mm) + 1e-9) & slow
        self.position_mm = np.where(arrived, self.setpoint_mm, self.position_mm + travel_mm)
        self._speed_mm_per_s = np.where(arrived, 0.0, self._speed_mm_per_s)
