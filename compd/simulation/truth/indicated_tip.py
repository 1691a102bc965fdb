"""The tip's place as the gauges indicate it, by the paper's equations (1) and (3) on the machine as drawn.

The simulated machine's own evaluation, independent of the model: true minus indicated place is the part of a cause
that the gauges do not measure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from compd.arrays import FloatArray
from compd.operation_settings import Wiring
from compd.simulation.truth.closure import Posture, homogeneous
from compd.simulation.truth.closure_kernels import CLOSED_MM
from compd.simulation.truth.frame import DISTANCE_ENDS, DISTANCES, distances_mm
from compd.simulation.truth.mechanism import Mechanism

# Equation (1): the two ball shanks of a revolute joint are averaged.
_WEIGHTS = {"S": 1.0, "B": 1.0, "Ra": 0.5, "Rb": 0.5}
MAX_ITERATIONS = 10


class IndicatedTip:
    """Evaluates gauge readings of a machine; all parts as drawn."""

    def __init__(self, mechanism: Mechanism, wiring: Wiring) -> None:
        self._mechanism = mechanism
        self._weights = np.zeros((mechanism.links, len(wiring.joint)))
        for k, wire in enumerate(wiring.joint):
            self._weights[wire.link - 1, k] = _WEIGHTS[wire.role]
        self._distances0_mm = distances_mm(mechanism.supports0_M, mechanism.plate0_M)

    def solve(self, readings: Mapping[str, float], guess: Posture) -> FloatArray:
        """(3,) mm, in {M}, or in {P} with the tool on the plate.

        readings : scale_1 .., joint_1 .., frame_t1 .. by name, mm. guess : a posture near by.
        Raises KinematicsError if the links cannot meet.
        """
        mechanism = self._mechanism
        scale_mm = np.array([readings[f"scale_{i + 1}"] for i in range(mechanism.scales)])
        joint_mm = np.array([readings[f"joint_{k + 1}"] for k in range(self._weights.shape[1])])
        supports_M = mechanism.supports0_M
        if mechanism.has_frame:
            frame_mm = np.array([readings.get(f"frame_{name}", 0.0) for name in DISTANCES])
            supports_M = self._supports_M(self._distances0_mm + frame_mm)
        base_M = mechanism.base_joints_M(supports_M, 0.0, scale_mm)
        lengths_mm = mechanism.lengths_at(scale_mm) - self._weights @ joint_mm
        closure = mechanism.turned_with_base(mechanism.closure, supports_M)
        posture = closure.by_lengths(base_M, mechanism.joints_P, lengths_mm, guess)
        if mechanism.tip_frame == "M":
            return np.asarray(homogeneous(mechanism.tip0_P) @ posture)
        return np.asarray(posture[1:] @ (mechanism.tip0_M - posture[0]))

    def _supports_M(self, measured_mm: FloatArray) -> FloatArray:
        """(3, 3) supports with these nine distances (9,), equation (3): Newton's method, starting at the drawing."""
        supports_M, plate_M = self._mechanism.supports0_M, self._mechanism.plate0_M
        for _ in range(MAX_ITERATIONS):
            residual_mm = measured_mm - distances_mm(supports_M, plate_M)
            if np.abs(residual_mm).max() < CLOSED_MM:
                break
            ends = np.concatenate([supports_M, plate_M])
            gradient = np.zeros((9, 6, 3))
            for row, (first, second) in enumerate(DISTANCE_ENDS):
                between = ends[first] - ends[second]
                along = between / math.sqrt(between @ between)
                gradient[row, first], gradient[row, second] = along, -along
            supports_M = supports_M + np.linalg.solve(gradient[:, :3].reshape(9, 9), residual_mm).reshape(3, 3)
        return supports_M
