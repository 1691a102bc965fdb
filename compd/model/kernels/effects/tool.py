"""Kernels of the effects at the port `tool`; see `compd.model.library.tool`."""

from __future__ import annotations

from compd.arrays import FloatArray
from compd.jit import helper
from compd.model.structures import EffectMachine, EffectRow

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
        basis[j, 0] = PPM * machine.tool_mm[j] * (quantities[0] - quantities[1])


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
    """Along the force that acts on the tool, less the deflection at machine zero.

    The external force F acts on what the platform carries. A tool on the platform gives way along F, R^T F in {P}. A
    tool on the plate loads the work with F, is pressed back with -F, and gives way along that in {M}.
    """
    for j in range(3):
        if machine.tool_on_plate:
            basis[j, 0] = -UM * (quantities[j] - quantities[3 + j])
        else:
            now_N = _along(row.rotation_M_P, j, quantities[:3])
            basis[j, 0] = UM * (now_N - _along(machine.zero_rotation_M_P, j, quantities[3:6]))


@helper
def _along(R: FloatArray, j: int, force_M_N: FloatArray) -> float:
    """A force's component along axis j of {P}."""
    return R[0, j] * force_M_N[0] + R[1, j] * force_M_N[1] + R[2, j] * force_M_N[2]  # type: ignore[no-any-return]
