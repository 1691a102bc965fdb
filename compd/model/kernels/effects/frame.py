"""Kernels of the effects at the port `frame`; see `compd.model.library.frame`."""

from __future__ import annotations

from compd.arrays import FloatArray
from compd.jit import helper
from compd.model.structures import EffectMachine, EffectRow

PPM = 1e-6


@helper
def gain(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for k in range(9):
        basis[k, 0] = -row.frame_mm[k]


@helper
def rod_expansion(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for k in range(9):
        basis[k, 0] = PPM * machine.frame_zero_mm[k] * (quantities[0] - quantities[1])
