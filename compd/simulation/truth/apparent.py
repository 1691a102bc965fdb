"""Where the gauges, read without fault by the paper's equations (1) and (3), take the tip to be.

The simulated machine's own reading of them: it tells how much of a cause the gauges do not see.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from compd.arrays import FloatArray
from compd.configuration.operation import Wiring
from compd.simulation.truth.closure import CLOSED_MM, Posture, homogeneous
from compd.simulation.truth.frame import DISTANCE_ENDS, DISTANCES, distances_mm
from compd.simulation.truth.mechanism import Mechanism

# Equation (1): the two ball shanks of a revolute joint are averaged.
_WEIGHTS = {"S": 1.0, "B": 1.0, "Ra": 0.5, "Rb": 0.5}
MOST_ITERATIONS = 10


class Apparent:
    """A machine as drawn, on which gauges are read."""

    def __init__(self, mechanism: Mechanism, wiring: Wiring) -> None:
        self._mechanism = mechanism
        self._weights = np.zeros((mechanism.links, len(wiring.joint)))
        for k, wire in enumerate(wiring.joint):
            self._weights[wire.link - 1, k] = _WEIGHTS[wire.role]
        self._distances0_mm = distances_mm(mechanism.supports0_M, mechanism.plate0_M)

    def tip(self, shown: Mapping[str, float], guess: Posture) -> FloatArray:
        """(3,) in {M}, or in {P} with the tool on the plate. `shown`: by name, mm; `guess`: a posture near by.

        Raises KinematicsError where the links cannot meet.
        """
        machine = self._mechanism
        scale_mm = np.array([shown[f"scale_{i + 1}"] for i in range(machine.links)])
        joint_mm = np.array([shown[f"joint_{k + 1}"] for k in range(self._weights.shape[1])])
        frame_mm = np.array([shown[f"frame_{name}"] for name in DISTANCES])
        base_M = machine.base_joints_M(self._supports_M(self._distances0_mm + frame_mm))
        lengths_mm = machine.lengths0_mm + scale_mm - self._weights @ joint_mm
        posture = machine.closure.by_lengths(base_M, machine.joints_P, lengths_mm, guess)
        if machine.tip_frame == "M":
            return np.asarray(homogeneous(machine.tip0_P) @ posture)
        return np.asarray(posture[1:] @ (machine.tip0_M - posture[0]))

    def _supports_M(self, wanted_mm: FloatArray) -> FloatArray:
        """Newton on nine distances, from the drawing."""
        supports_M, plate_M = self._mechanism.supports0_M, self._mechanism.plate0_M
        for _ in range(MOST_ITERATIONS):
            missing_mm = wanted_mm - distances_mm(supports_M, plate_M)
            if np.abs(missing_mm).max() < CLOSED_MM:
                break
            ends = np.concatenate([supports_M, plate_M])
            gradient = np.zeros((9, 6, 3))
            for row, (first, second) in enumerate(DISTANCE_ENDS):
                along = (ends[first] - ends[second]) / np.linalg.norm(ends[first] - ends[second])
                gradient[row, first], gradient[row, second] = along, -along
            supports_M = supports_M + np.linalg.solve(gradient[:, :3].reshape(9, 9), missing_mm).reshape(3, 3)
        return supports_M
