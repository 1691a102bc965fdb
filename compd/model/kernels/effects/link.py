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
def _hertz(force_N: float) -> float:
    return math.copysign(np.cbrt(force_N * force_N), force_N)


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
        basis[i, 0] = UM * (_hertz(axial_N[i]) - _hertz(axial_force_at_zero(machine, quantities[3:6], i)))


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
