"""Kernels of the effects at the port `base_joint`; see `compd.model.library.base_joint`."""

from __future__ import annotations

import math

from compd.arrays import FloatArray
from compd.jit import helper
from compd.model.structures import EffectMachine, EffectRow

UM = 1e-3  # mm


@helper
def position(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for j in range(basis.shape[0]):
        basis[j, j] = UM


@helper
def runout(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """Columns: angle and wave outside, links inside; each moves its own joint along the revolute axis.

    One harmonic will do: over the 10 or 15 degrees that a joint turns, a second and a third one look like the first
    to within a hundredth, and fitted together they could not be told apart.
    """
    n = row.links
    R = row.rotation_M_P
    for h in range(machine.axes):
        i = machine.hinges[h, 0]
        sine_p, cosine_p, sine_q, cosine_q = _turned(row, machine, i)
        e = machine.revolute_axes_P[h]
        for j in range(3):
            axis_M = e[j] if machine.hinges[h, 1] == 1 else R[j, 0] * e[0] + R[j, 1] * e[1] + R[j, 2] * e[2]
            basis[3 * i + j, i] = UM * sine_p * axis_M
            basis[3 * i + j, n + i] = UM * (cosine_p - constants[0]) * axis_M
            basis[3 * i + j, 2 * n + i] = UM * sine_q * axis_M
            basis[3 * i + j, 3 * n + i] = UM * (cosine_q - constants[0]) * axis_M


@helper
def _turned(row: EffectRow, machine: EffectMachine, i: int) -> tuple[float, float, float, float]:
    """Sine and cosine of the rotation of base joint i since machine zero: towards its zero axis, and square to that."""
    dx, dy, dz = row.directions_M[i, 0], row.directions_M[i, 1], row.directions_M[i, 2]
    zx, zy, zz = (
        machine.zero_directions_M[i, 0],
        machine.zero_directions_M[i, 1],
        machine.zero_directions_M[i, 2],
    )
    ax, ay, az = machine.zero_axes_M[i, 0], machine.zero_axes_M[i, 1], machine.zero_axes_M[i, 2]
    along = dx * zx + dy * zy + dz * zz
    towards = dx * ax + dy * ay + dz * az
    across = dx * (zy * az - zz * ay) + dy * (zz * ax - zx * az) + dz * (zx * ay - zy * ax)
    p_rad, q_rad = math.atan2(towards, along), math.atan2(across, along)
    return math.sin(p_rad), math.cos(p_rad), math.sin(q_rad), math.cos(q_rad)
