"""Causes in the comparators: what they make of what is there."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import PPM, UM, Cause, Interval
from compd.simulation.truth.frame import distances_mm
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.warm_up import WarmUp

# A comparator's holder of 0.1 kg warms up by conduction from the part that it is screwed to.
HOLDER_TAU_S = 120.0
# A rod hangs in the air around the frame; this share of its warmth is its own column's.
OWN_COLUMN_SHARE = 0.25
# Which columns' supports a distance's rod ends at: t1 = b1 b2, t2 = b2 b3, t3 = b3 b1, then u1 .. u6.
_COLUMNS = ((0, 1), (1, 2), (2, 0), (0,), (0,), (1,), (1,), (2,), (2,))


class JointComparatorGain(Cause):
    """A lever or conditioner set up wrongly: all joint comparators show too much by the same share of it."""

    id, unit, most, signed = "joint_comparator_gain", "1", 0.2, True

    def joint_seen(self, joint_mm: FloatArray) -> FloatArray:
        return np.asarray(joint_mm / (1 - self.strength))


class JointComparatorDrift(Cause):
    """The holders grow and take the comparators away from the balls, a little after the platform has warmed up."""

    id, unit, most, signed = "joint_comparator_drift", "um/K", 0.5, True

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self._holder_K = 0.0

    def pass_time(self, travel: Interval, warm: WarmUp) -> None:
        platform_K = warm.over_reference_K("platform")
        self._holder_K = platform_K + (self._holder_K - platform_K) * float(np.exp(-travel.weather_s / HOLDER_TAU_S))

    def joint_seen(self, joint_mm: FloatArray) -> FloatArray:
        return joint_mm + self.strength * UM * self._holder_K


class FrameComparatorGain(Cause):
    """All frame comparators show too much by the same share of what they show."""

    id, unit, most, signed = "frame_comparator_gain", "1", 0.05, True

    def frame_seen(self, frame_mm: FloatArray, warm: WarmUp) -> FloatArray:
        return np.asarray(frame_mm / (1 - self.strength))


class FrameRodExpansion(Cause):
    """The rods grow, each by its own temperature: that of the frame as a whole, and some of its own column's."""

    id, unit, most = "frame_rod_expansion", "ppm/K", 12.0

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self._distances0_mm = distances_mm(machine.supports0_M, machine.plate0_M)

    def frame_seen(self, frame_mm: FloatArray, warm: WarmUp) -> FloatArray:
        columns_K = warm.columns_K.mean(axis=(1, 2))
        own_K = np.array([columns_K[list(ends)].mean() for ends in _COLUMNS])
        rods_K = columns_K.mean() + OWN_COLUMN_SHARE * (own_K - columns_K.mean())
        return np.asarray(frame_mm - self.strength * PPM * self._distances0_mm * rods_K)


CAUSES = (JointComparatorGain, JointComparatorDrift, FrameComparatorGain, FrameRodExpansion)
