"""Causes in the joint and frame comparators: errors between a comparator's reading and the true displacement."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import PPM, UM, Cause, Interval
from compd.simulation.truth.frame import distances_mm
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.warm_up import WarmUp

# A comparator's holder of 0.1 kg warms up by conduction from the part that it is screwed to.
HOLDER_TAU_S = 120.0
# A rod hangs in the air around the frame; this share of its temperature is that of the columns at its ends.
OWN_COLUMN_SHARE = 0.25
# Columns at whose supports each distance ends: t1 = b1 b2, t2 = b2 b3, t3 = b3 b1, then u1 .. u6.
_COLUMNS = ((0, 1), (1, 2), (2, 0), (0,), (0,), (1,), (1,), (2,), (2,))


class JointComparatorGain(Cause):
    """Wrong gain of lever or conditioner, the same in all joint comparators: reading = true / (1 - k).

    Strength: k, the share of the reading that is wrong.
    """

    id = "joint_comparator_gain"
    unit = "1"
    max_strength = 0.2
    acts_on_joint_comparators = True
    signed = True

    def joint_reading_mm(self, joint_mm: FloatArray) -> FloatArray:
        return np.asarray(joint_mm / (1 - self.strength))


class JointComparatorDrift(Cause):
    """Thermal growth of the comparators' holders: reading = true + d (T_holder - its value at machine zero).

    T_holder follows the platform's temperature with a time constant of 120 s. Strength: d.
    """

    id = "joint_comparator_drift"
    unit = "um/K"
    max_strength = 0.5
    acts_on_joint_comparators = True
    signed = True

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self._holder_K = 0.0

    def pass_time(self, interval: Interval, warm: WarmUp) -> None:
        platform_K = warm.since_zero_K("platform")
        self._holder_K = platform_K + (self._holder_K - platform_K) * float(np.exp(-interval.weather_s / HOLDER_TAU_S))

    def joint_reading_mm(self, joint_mm: FloatArray) -> FloatArray:
        return joint_mm + self.strength * UM * self._holder_K


class FrameComparatorGain(Cause):
    """Wrong gain, the same in all frame comparators: reading = true / (1 - k). Strength: k."""

    id = "frame_comparator_gain"
    unit = "1"
    max_strength = 0.05
    acts_on_frame = True
    signed = True

    def frame_reading_mm(self, frame_mm: FloatArray, warm: WarmUp) -> FloatArray:
        return np.asarray(frame_mm / (1 - self.strength))


class FrameRodExpansion(Cause):
    """Thermal expansion of the frame comparators' rods: reading = true - alpha L (T_rod - its value at machine zero).

    T_rod is the frame's mean temperature plus a quarter of what the columns at the rod's ends depart from it.
    Strength: alpha (Super-Invar 0.5, Invar 1.5, steel 11 ppm/K).
    """

    id = "frame_rod_expansion"
    unit = "ppm/K"
    max_strength = 12.0
    acts_on_frame = True

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self._distances0_mm = distances_mm(mechanism.supports0_M, mechanism.plate0_M)

    def frame_reading_mm(self, frame_mm: FloatArray, warm: WarmUp) -> FloatArray:
        columns_K = warm.columns_K.mean(axis=(1, 2))
        own_K = np.array([columns_K[list(ends)].mean() for ends in _COLUMNS])
        rods_K = columns_K.mean() + OWN_COLUMN_SHARE * (own_K - columns_K.mean())
        return np.asarray(frame_mm - self.strength * PPM * self._distances0_mm * rods_K)


CAUSES = (JointComparatorGain, JointComparatorDrift, FrameComparatorGain, FrameRodExpansion)
