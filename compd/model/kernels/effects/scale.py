"""Kernels of the effects at the port `scale`; see `compd.model.library.scale`."""

from __future__ import annotations

import math

from compd.arrays import FloatArray
from compd.jit import helper
from compd.model.kernels.memory import friction_step
from compd.model.structures import EffectMachine, EffectRow
from compd.reference_conditions import REFERENCE_TEMPERATURE_degC
from compd.travel_direction import REVERSAL_MM

PPM = 1e-6
UM = 1e-3  # mm
MS = 1e-3  # s


@helper
def gain(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for i in range(row.scales):
        basis[i, i] = PPM * row.scale_mm[i]


@helper
def expansion(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """A graduation has its own reference: it is true at 20 degC (ISO 1), wherever machine zero was taken."""
    for i in range(row.scales):
        basis[i, 0] = PPM * row.scale_mm[i] * (quantities[i] - REFERENCE_TEMPERATURE_degC)


@helper
def cyclic(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    n = row.scales
    for i in range(n):
        phase_rad = 2 * math.pi / constants[0] * row.scale_mm[i]
        basis[i, i] = UM * math.sin(phase_rad)
        basis[i, n + i] = UM * math.cos(phase_rad)
        basis[i, 2 * n + i] = UM * math.sin(2 * phase_rad)
        basis[i, 3 * n + i] = UM * math.cos(2 * phase_rad)


@helper
def backlash(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for i in range(row.scales):
        if row.direction[i] > 0.0:
            basis[i, i] = -UM / 2
        elif row.direction[i] < 0.0:
            basis[i, i] = UM / 2
        else:
            basis[i, i] = row.direction[i]  # 0 where the direction is not known; nan stays nan


@helper
def hysteresis(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """Memory: the position of each link, then its strain."""
    n = row.scales
    for i in range(n):
        position_mm = row.scale_mm[i]
        if math.isnan(position_mm):
            basis[i, 0] = math.nan  # and is left out of the memory
            continue
        memory[n + i] = friction_step(
            position_mm,
            row.direction[i],
            row.session_start != 0,
            constants[0],
            constants[1],
            REVERSAL_MM,
            memory[i],
            memory[n + i],
        )
        memory[i] = position_mm
        basis[i, 0] = -UM * memory[n + i]


@helper
def latency(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    n = row.scales
    for i in range(n):
        basis[i, 0] = MS * row.velocity_mm_per_s[i]
    for k in range(basis.shape[0] - n):
        basis[n + k, 0] = MS * row.joint_velocity_mm_per_s[k]
