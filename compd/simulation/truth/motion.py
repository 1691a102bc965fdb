"""Motion of the links: a tour from point to point, or along a controller's scale setpoints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from compd.arrays import FloatArray

Phase = Literal["moving", "dwelling"]

# Drives of a measuring machine.
SPEED_MM_PER_S = 50.0
ACCELERATION_MM_PER_S2 = 250.0


class Drives(NamedTuple):
    """Limits of the drives of each link: speed, mm/s, and acceleration, mm/s2."""

    mm_per_s: float = SPEED_MM_PER_S
    mm_per_s2: float = ACCELERATION_MM_PER_S2


DRIVES = Drives()


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

    def speeds_mm_per_s(self, time_s: float) -> FloatArray:
        """(n,) speeds `time_s` after the start."""
        ramp_s = max(0.0, min(self._ramp_s, time_s, self.duration_s - time_s))
        if ramp_s == 0:
            return np.zeros_like(self.start_mm)
        return (ACCELERATION_MM_PER_S2 * ramp_s / self._way_mm) * (self.end_mm - self.start_mm)


class Approach:
    """Motion of each link by itself from any speed to rest at its end, as soon as speed and acceleration allow.

    A link that cannot stop at its end any more comes back to it.
    """

    def __init__(
        self, start_mm: FloatArray, start_mm_per_s: FloatArray, end_mm: FloatArray, drives: Drives = DRIVES
    ) -> None:
        """`start_mm`, `end_mm`: (n,). `start_mm_per_s`: (n,), at most the speed of the drives."""
        self.end_mm = end_mm
        self._start_mm, self._start_mm_per_s, self._drives = start_mm, start_mm_per_s, drives
        acceleration = drives.mm_per_s2
        self._sign = np.where(end_mm >= stopping_place_mm(start_mm, start_mm_per_s, drives), 1.0, -1.0)
        way_mm, speed = self._sign * (end_mm - start_mm), self._sign * start_mm_per_s
        peak = np.minimum(np.sqrt(np.maximum(acceleration * way_mm + speed**2 / 2, 0.0)), drives.mm_per_s)
        even_mm = np.maximum(way_mm - (2 * peak**2 - speed**2) / (2 * acceleration), 0.0)
        self._peak_mm_per_s = peak
        # ends of speeding up, of even speed and of braking, s
        self._faster_s = np.maximum(peak - speed, 0.0) / acceleration
        self._even_s = self._faster_s + even_mm / drives.mm_per_s
        self._ends_s = self._even_s + peak / acceleration
        self.duration_s = float(self._ends_s.max())
        # of each link: a position is asked for so often that calls of NumPy would take most of the time
        self._profile = np.transpose(
            [
                start_mm,
                start_mm_per_s,
                end_mm,
                0.5 * acceleration * self._sign,
                self._sign * peak,
                self._faster_s,
                self._even_s,
                self._ends_s,
            ]
        ).tolist()

    def position_mm(self, time_s: float) -> FloatArray:
        """(n,) scale positions `time_s` after the start; `end_mm` after the end."""
        if time_s >= self.duration_s:
            return self.end_mm
        return np.array([_position_mm(time_s, *link) for link in self._profile])

    def speeds_mm_per_s(self, time_s: float) -> FloatArray:
        """(n,) speeds `time_s` after the start."""
        acceleration = self._drives.mm_per_s2 * self._sign
        faster_s, left_s = np.minimum(time_s, self._faster_s), np.maximum(self._ends_s - time_s, 0.0)
        before = self._start_mm_per_s + acceleration * faster_s
        speeds: FloatArray = np.where(time_s < self._even_s, before, acceleration * left_s)
        return speeds


def _position_mm(
    time_s: float,
    start_mm: float,
    start_mm_per_s: float,
    end_mm: float,
    half_mm_per_s2: float,
    even_mm_per_s: float,
    faster_s: float,
    even_s: float,
    end_s: float,
) -> float:
    """Position of one link: speeding up until `faster_s`, evenly until `even_s`, braking until `end_s`, s."""
    if time_s >= even_s:
        left_s = max(end_s - time_s, 0.0)
        return end_mm - half_mm_per_s2 * (left_s * left_s)
    speeding_s = min(time_s, faster_s)
    speeding_mm = half_mm_per_s2 * (speeding_s * speeding_s)
    return start_mm + start_mm_per_s * speeding_s + speeding_mm + even_mm_per_s * max(time_s - faster_s, 0.0)


def stopping_place_mm(start_mm: FloatArray, start_mm_per_s: FloatArray, drives: Drives = DRIVES) -> FloatArray:
    """(n,) stopping positions of links that brake from now on."""
    return start_mm + start_mm_per_s * np.abs(start_mm_per_s) / (2 * drives.mm_per_s2)


def braking(start_mm: FloatArray, start_mm_per_s: FloatArray, drives: Drives = DRIVES) -> Approach:
    """Motion of links that come to rest."""
    return Approach(start_mm, start_mm_per_s, stopping_place_mm(start_mm, start_mm_per_s, drives), drives)


def standing(here_mm: FloatArray) -> Approach:
    """No motion: the links stand at `here_mm`, (n,)."""
    return Approach(here_mm, np.zeros_like(here_mm), here_mm)


class TourMotion:
    """Endless tour of points in random order, with a dwell at each."""

    def __init__(self, start: Approach, points_mm: FloatArray, dwell_s: float, rng: np.random.Generator) -> None:
        """start : how the links come to rest first, (n,) of them. points_mm : (points, n) scale values."""
        self._points_mm = points_mm
        self._dwell_s = dwell_s
        self._rng = rng
        self.point = 0
        self._since_s = 0.0
        self._move: Move | Approach = start
        if start.duration_s == 0:
            self._depart(start.end_mm)

    @property
    def phase(self) -> Phase:
        return "moving" if self._since_s < self._move.duration_s else "dwelling"

    @property
    def position_mm(self) -> FloatArray:
        return self._move.position_mm(self._since_s)

    @property
    def speeds_mm_per_s(self) -> FloatArray:
        return self._move.speeds_mm_per_s(self._since_s)

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
    """Motion of each link to its own setpoint within limits of speed and acceleration."""

    point = None

    def __init__(self, start: Approach, drives: Drives = DRIVES) -> None:
        """start : motion of the (n,) links until the first setpoint is given."""
        self._approach, self._drives = start, drives
        self._since_s = 0.0

    @property
    def setpoint_mm(self) -> FloatArray:
        """(n,) targets of the links."""
        return self._approach.end_mm

    @setpoint_mm.setter
    def setpoint_mm(self, setpoint_mm: FloatArray) -> None:
        self._approach = Approach(self.position_mm, self.speeds_mm_per_s, setpoint_mm, self._drives)
        self._since_s = 0.0

    @property
    def position_mm(self) -> FloatArray:
        return self._approach.position_mm(self._since_s)

    @property
    def speeds_mm_per_s(self) -> FloatArray:
        return self._approach.speeds_mm_per_s(self._since_s)

    @property
    def phase(self) -> Phase:
        return "moving" if self._since_s < self._approach.duration_s else "dwelling"

    def advance(self, time_s: float) -> float:
        """Advance by `time_s`; returns how many seconds of it the links moved."""
        moved_s = min(time_s, max(0.0, self._approach.duration_s - self._since_s))
        self._since_s += time_s
        return moved_s
