"""Kernels of the effects at the port `tool`; see `compd.model.library.tool`."""

from __future__ import annotations

from compd.arrays import FloatArray
from compd.model.kernels.effect_row import EffectMachine, EffectRow
from compd.model.kernels.jit import helper
from compd.model.reference_conditions import REFERENCE_TEMPERATURE_degC

PPM = 1e-6
UM = 1e-3  # mm


@helper
def expansion(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """Along the tool vector, from the origin of its frame: the platform's, or the plate's."""
    for j in range(3):
        basis[j, 0] = PPM * machine.tool_mm[j] * (quantities[0] - REFERENCE_TEMPERATURE_degC)


@helper
def offset(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for j in range(3):
        basis[j, j] = UM


@helper
def bending(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """Along the force that acts on the tool.

    The external force F acts on what the platform carries. A tool on the platform gives way along F, R^T F in {P}. A
    tool on the plate loads the work with F, is pressed back with -F, and gives way along that in {M}.
    """
    R, force_M_N = row.rotation_M_P, quantities
    for j in range(3):
        if machine.tool_on_plate:
            basis[j, 0] = -UM * force_M_N[j]
        else:
            basis[j, 0] = UM * (R[0, j] * force_M_N[0] + R[1, j] * force_M_N[1] + R[2, j] * force_M_N[2])
