"""Kernels of the effects at the port `joint`; see `compd.model.library.joint`."""

from __future__ import annotations

from compd.arrays import FloatArray
from compd.jit import helper
from compd.model.structures import EffectMachine, EffectRow

UM = 1e-3  # mm


@helper
def gain(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for k in range(basis.shape[0]):
        basis[k, 0] = -row.joint_mm[k]


@helper
def drift(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for k in range(basis.shape[0]):
        basis[k, 0] = -UM * (quantities[0] - quantities[1])
