"""Gauge readings: true values with noise, rounded to the gauges' resolution."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Geometry
from compd.operation_settings import Wiring
from compd.simulation.truth.frame import DISTANCES
from compd.simulation.truth.joints import Balls
from compd.simulation.truth.strengths import Strengths

UM = 1e-3
# A good interpolator divides the signal period by 4096; without a period, the displays' step of 0.1 um.
INTERPOLATION = 4096
DISPLAY_STEP_MM = 1e-4


class Sensors:
    """Scales `scale_1`.., joint comparators `joint_1`.. in the wiring's order, and of `frame_t1`.. `frame_u6` those
    that are wired."""

    def __init__(self, geometry: Geometry, wiring: Wiring, strengths: Strengths, rng: np.random.Generator) -> None:
        period_mm = geometry.scale_signal_period_mm
        ideal = strengths.comparator_step_um == 0
        self._scale_step_mm = 0.0 if ideal else period_mm / INTERPOLATION if period_mm else DISPLAY_STEP_MM
        self._joints = [(wire.role, wire.link - 1) for wire in wiring.joint]
        self._distances = {wire.distance for wire in wiring.frame}
        self._strengths = strengths
        self._rng = rng
        self._gauges = 0  # of the last reading

    def read(
        self, scale_mm: FloatArray, joint_mm: FloatArray, frame_mm: FloatArray, thermometers_degC: Mapping[str, float]
    ) -> dict[str, float]:
        """One noisy reading of every gauge by name, mm and degC, from true values (n,), (k,) and (9,)."""
        step_mm = self._strengths.comparator_step_um * UM
        noise_mm = self._strengths.comparator_noise_um * UM
        scale = self.scale_mm(scale_mm)
        joint = self._measure(joint_mm, noise_mm, step_mm)
        frame = self._measure(frame_mm, noise_mm, step_mm)
        degC = np.array(list(thermometers_degC.values()))
        self._gauges = len(scale) + len(joint) + len(frame) + len(degC)
        thermometer = self._measure(degC, self._strengths.thermometer_noise_K, 0.0)
        return {
            **{f"scale_{i + 1}": value for i, value in enumerate(scale.tolist())},
            **{f"joint_{k + 1}": value for k, value in enumerate(joint.tolist())},
            **{
                f"frame_{name}": value
                for name, value in zip(DISTANCES, frame.tolist(), strict=True)
                if name in self._distances
            },
            **dict(zip(thermometers_degC, thermometer.tolist(), strict=True)),
        }

    def skip_reading(self) -> None:
        """Draw the noise of one reading like the last one, which nobody takes: what follows has the same noise."""
        self._rng.standard_normal(self._gauges)

    def scale_mm(self, scale_mm: FloatArray) -> FloatArray:
        """(n,) one noisy reading of every scale, from true values (n,)."""
        return self._measure(scale_mm, self._strengths.scale_noise_um * UM, self._scale_step_mm)

    def joint_values_mm(self, balls: Balls) -> FloatArray:
        """(k,) true displacements at the joint comparators, positive where they shorten the link: equation (1)."""
        by_role = {
            "S": -balls.base_along_mm,
            "Ra": balls.platform_along_mm + balls.shank_mm,
            "Rb": balls.platform_along_mm - balls.shank_mm,
            "B": balls.platform_along_mm,
        }
        return np.array([by_role[role][link] for role, link in self._joints])

    def _measure(self, value: FloatArray, noise: float, step: float) -> FloatArray:
        noisy = value + noise * self._rng.standard_normal(len(value))
        return np.asarray(np.rint(noisy / step) * step) if step > 0 else noisy
