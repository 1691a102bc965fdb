"""A machine that moves and dwells, seen by its scales and by an instrument with another clock and rate."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from compd.instruments import Track

# Base joints of a tripod, in mm; the scales are distances from them, as on the real thing, and nothing polynomial.
_BASE_MM = np.array([[0.0, 250.0, 700.0], [-216.5, -125.0, 700.0], [216.5, -125.0, 700.0]])


@dataclass(frozen=True)
class TipPath:
    """Targets reached one after another: a move of 0.6 to 2 s with smooth ends, then a dwell."""

    arrive_s: FloatArray
    leave_s: FloatArray
    target_mm: FloatArray

    @property
    def end_s(self) -> float:
        return float(self.leave_s[-1])

    def tip(self, time_s: FloatArray) -> FloatArray:
        """(N, 3) where the tip is."""
        k = np.clip(np.searchsorted(self.leave_s, time_s, side="right") - 1, 0, len(self.leave_s) - 2)
        phase = np.clip((time_s - self.leave_s[k]) / (self.arrive_s[k + 1] - self.leave_s[k]), 0.0, 1.0)
        smooth = phase * phase * (3.0 - 2.0 * phase)
        tip_mm: FloatArray = self.target_mm[k] + smooth[:, None] * (self.target_mm[k + 1] - self.target_mm[k])
        return tip_mm

    def scales(self, time_s: FloatArray) -> FloatArray:
        """(N, 3) what the scales show."""
        length_mm: FloatArray = np.linalg.norm(self.tip(time_s)[:, None, :] - _BASE_MM, axis=2)
        return length_mm - 600.0


def random_path(rng: np.random.Generator, targets: int, dwell_s: tuple[float, float]) -> TipPath:
    """A random path; dwells last between the two."""
    target_mm = rng.uniform([-90, -90, 130], [90, 90, 250], (targets, 3))
    move_s, stay_s = rng.uniform(0.6, 2.0, targets), rng.uniform(*dwell_s, targets)
    leave_s = np.cumsum(move_s + stay_s)
    return TipPath(leave_s - stay_s, leave_s, target_mm)


def track_of(
    path: TipPath, rng: np.random.Generator, offset_s: float, period_s: float, noise_mm: float
) -> tuple[Track, FloatArray]:
    """The instrument's samples over the whole path, its clock `offset_s` behind, in a frame of its own; and the
    rotation and shift (4, 3) of that frame."""
    time_s = np.arange(0.0, path.end_s, period_s)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    shift_mm = np.array([1200.0, -300.0, 80.0])
    seen_mm = path.tip(time_s) @ turn + shift_mm + rng.normal(0.0, noise_mm, (len(time_s), 3))
    return Track(Path("tracker.csv"), time_s - offset_s, seen_mm, ("x", "y", "z")), np.vstack([turn, shift_mm])
