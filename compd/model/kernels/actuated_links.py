"""Actuators that extend links or move base joints.

With q the place of an actuator in mm and u, v unit vectors in {M}, the base joint and the length of its links are

    EXTENDS    a = a0,                                            l = l0 + q
    SLIDES     a = a0 + q u,                                      l = l0
    TURNS      a = a0 + radius (cos(q/radius) u + sin(q/radius) v),   l = l0

(q of a turning actuator is the arc, radius times the angle).
"""

from __future__ import annotations

import math
from typing import Any

from compd.arrays import FloatArray, IntArray
from compd.jit import INTEGERS, MATRIX, VECTOR, helper, kernel

EXTENDS, SLIDES, TURNS = range(3)


@helper
def place_links(
    kinds: IntArray,
    cosine_M: FloatArray,
    sine_M: FloatArray,
    radius_mm: FloatArray,
    actuator_of_link: IntArray,
    base_joints_M: FloatArray,
    rod_length_mm: FloatArray,
    actuator_mm: FloatArray,
    joints_M: FloatArray,
    lengths_mm: FloatArray,
) -> None:
    """Base joints (n, 3) and link lengths (n,) with the actuators at actuator_mm (m,); base_joints_M : at q = 0.

    See `compd.model.kinematics.actuators.links_at`.
    """
    for i in range(actuator_of_link.shape[0]):
        a = actuator_of_link[i]
        q = actuator_mm[a]
        lengths_mm[i] = rod_length_mm[i] + (q if kinds[a] == EXTENDS else 0.0)
        for j in range(3):
            joints_M[i, j] = base_joints_M[i, j]
            if kinds[a] == SLIDES:
                joints_M[i, j] += q * cosine_M[a, j]
            elif kinds[a] == TURNS:
                angle = q / radius_mm[a]
                joints_M[i, j] += radius_mm[a] * (math.cos(angle) * cosine_M[a, j] + math.sin(angle) * sine_M[a, j])


@helper
def closure_by_actuators(
    model: Any, machine: Any, actuator_mm: FloatArray, J: FloatArray, by_actuator: FloatArray
) -> None:
    """Derivatives (6, m) of the closure's rows, |d_i| - l_i and the offsets of the hinges, by the actuators.

    J : (6, 6) of `evaluate_closure`; its first three columns are the rows' directions.
    """
    n, kinds, radius_mm = model.links, model.kinds, model.radius_mm
    by_actuator[:, :] = 0.0
    for row in range(6):
        a = model.of_link[row if row < n else model.hinges[row - n, 0]]
        if kinds[a] == EXTENDS:
            by_actuator[row, a] = -1.0 if row < n else 0.0
            continue
        angle = actuator_mm[a] / radius_mm[a] if kinds[a] == TURNS else 0.0
        for j in range(3):
            along = machine.cosine_M[a, j]
            if kinds[a] == TURNS:
                along = math.cos(angle) * machine.sine_M[a, j] - math.sin(angle) * machine.cosine_M[a, j]
            by_actuator[row, a] -= J[row, j] * along


placed_links = kernel(
    [INTEGERS, MATRIX, MATRIX, VECTOR, INTEGERS, MATRIX, VECTOR, VECTOR, MATRIX, VECTOR],
    "(m),(m,d),(m,d),(m),(n),(n,d),(n),(m)->(n,d),(n)",
)(place_links)
