"""Kernels of the effects of a drawing that only a calibration fits; see `compd.model.library.drawing`."""

from __future__ import annotations

import math

import numpy as np

from compd.arrays import FloatArray
from compd.jit import helper
from compd.model.structures import EffectMachine, EffectRow

PPM = 1e-6
UM = 1e-3  # mm
URAD = 1e-6
SLIDES, TURNS = 1, 2  # of `compd.model.kinematics.actuators.ACTUATOR_KINDS`


@helper
def actuator_zero(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for i in range(row.scales):
        basis[i, i] = UM


@helper
def gain_change(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for i in range(row.scales):
        basis[i, i] = PPM * row.scale_mm[i] ** 2


@helper
def actuator_direction(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """A rail turns about its place at 0; the plane of a circle about its cosine and its sine axis."""
    m = row.scales
    first, second, normal = np.empty(3), np.empty(3), np.empty(3)
    for i in range(row.links):
        s = machine.scale_of_link[i]
        u, v = machine.cosine_M[s], machine.sine_M[s]
        actuator_mm = machine.zero_actuator_mm[s] + row.scale_mm[s]
        if machine.kinds[s] == SLIDES:
            _set_square_to(u, first, second)
            for j in range(3):
                basis[3 * i + j, s] = URAD * actuator_mm * first[j]
                basis[3 * i + j, m + s] = URAD * actuator_mm * second[j]
        elif machine.kinds[s] == TURNS:
            radius_mm = machine.radius_mm[s]
            angle = actuator_mm / radius_mm
            _set_cross(u, v, normal)
            for j in range(3):
                basis[3 * i + j, s] = URAD * radius_mm * math.sin(angle) * normal[j]
                basis[3 * i + j, m + s] = -URAD * radius_mm * math.cos(angle) * normal[j]


@helper
def crank_radius(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """A scale shows mm of arc, so that with a larger radius the same reading is a smaller angle."""
    for i in range(row.links):
        s = machine.scale_of_link[i]
        if machine.kinds[s] == TURNS:
            angle = (machine.zero_actuator_mm[s] + row.scale_mm[s]) / machine.radius_mm[s]
            cosine, sine = math.cos(angle), math.sin(angle)
            for j in range(3):
                outwards = cosine * machine.cosine_M[s, j] + sine * machine.sine_M[s, j]
                onwards = cosine * machine.sine_M[s, j] - sine * machine.cosine_M[s, j]
                basis[3 * i + j, s] = UM * (outwards - angle * onwards)


@helper
def hinge_inclination(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """Towards the third axis of the frame that carries the hinge, square to the hinge's own axis."""
    for h in range(machine.axes):
        e = machine.revolute_axes_P[h]
        for j in range(3):
            third = 1.0 if j == 2 else 0.0
            basis[3 * h + j, h] = URAD * (third - e[2] * e[j])


@helper
def _set_square_to(u: FloatArray, first: FloatArray, second: FloatArray) -> None:
    """Two unit vectors square to u (3,): the axis of {M} that is farthest from u, less what it has of u; then u x it.

    Of axes that are equally far the first counts.
    """
    axis = 0
    for j in range(1, 3):
        if abs(u[j]) < abs(u[axis]) - 1e-9:
            axis = j
    size = math.sqrt(1.0 - u[axis] ** 2)
    for j in range(3):
        own = 1.0 if j == axis else 0.0
        first[j] = (own - u[axis] * u[j]) / size
    _set_cross(u, first, second)


@helper
def _set_cross(a: FloatArray, b: FloatArray, result: FloatArray) -> None:
    result[0] = a[1] * b[2] - a[2] * b[1]
    result[1] = a[2] * b[0] - a[0] * b[2]
    result[2] = a[0] * b[1] - a[1] * b[0]
