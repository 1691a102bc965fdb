"""Kernels of the effects at the port `link`; see `compd.model.library.link`."""

from __future__ import annotations

import math

import numpy as np

from compd.arrays import FloatArray
from compd.jit import helper
from compd.model.kernels.link_forces import axial_force_at_zero, set_axial_forces
from compd.model.kernels.memory import lag_step
from compd.model.structures import EffectMachine, EffectRow

PPM = 1e-6
UM = 1e-3  # mm
SAG_LENGTH_MM = 500.0  # the length at which a link's sag is stated
OPENS_AT = math.sqrt(8.0)  # force over preload at which one of two seats opens: (2 d)^(3/2) over d^(3/2)


@helper
def expansion(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for i in range(row.links):
        basis[i, 0] = PPM * row.link_mm[i] * (quantities[i] - quantities[row.links + i])


@helper
def lagged_expansion(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """Memory: the time of each link's last row, its warming then, and the rod's."""
    n = row.links
    for i in range(n):
        warming_K = quantities[i] - quantities[n + i]
        if math.isnan(warming_K):
            basis[i, 0] = math.nan  # and is left out of the memory: the next one follows on the last that was known
            continue
        memory[2 * n + i] = lag_step(
            row.time_s, warming_K, row.session_start != 0, constants[0], memory[i], memory[n + i], memory[2 * n + i]
        )
        memory[i] = row.time_s
        memory[n + i] = warming_K
        basis[i, 0] = PPM * row.link_mm[i] * memory[2 * n + i]


@helper
def elasticity(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    axial_N = np.empty(row.links)
    set_axial_forces(row, machine, quantities, axial_N)
    for i in range(row.links):
        basis[i, 0] = UM * (axial_N[i] - axial_force_at_zero(machine, quantities[3:6], i))


@helper
def _hertz(force_N: float, preload_N: float) -> float:
    """Approach, in N^(2/3), of a ball between two seats that a preload presses on it.

    A seat pushes by a^(3/2) for its approach a. With d = preload^(2/3) and x the ball's displacement

        F = (d + x)^(3/2) - (d - x)^(3/2)  for |x| <= d,  and  (d + x)^(3/2)  beyond, where the other seat is open.

    With w^2 = 1 - (x / d)^2 the first is a cubic equation, w^3 + 3 w^2 = 4 - (F / preload)^2 / 2, which the cosine of
    a third of an angle solves.
    """
    size_N = abs(force_N)
    if size_N >= OPENS_AT * preload_N:
        return math.copysign(np.cbrt(size_N * size_N) - np.cbrt(preload_N * preload_N), force_N)
    angle = 2 / 3 * math.asin(size_N / (OPENS_AT * preload_N))
    share = 2 * math.sqrt(2 * math.cos(angle)) * math.sin(angle / 2)
    return math.copysign(np.cbrt(preload_N * preload_N) * share, force_N)


@helper
def contact(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    axial_N = np.empty(row.links)
    set_axial_forces(row, machine, quantities, axial_N)
    for i in range(row.links):
        at_zero = _hertz(axial_force_at_zero(machine, quantities[3:6], i), constants[0])
        basis[i, 0] = UM * (_hertz(axial_N[i], constants[0]) - at_zero)


@helper
def sag(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for i in range(row.links):
        leaning = 1 - row.directions_M[i, 2] ** 2
        basis[i, 0] = -UM * leaning * (row.link_mm[i] / SAG_LENGTH_MM) ** constants[0]


@helper
def zero(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for i in range(row.links):
        basis[i, i] = UM
