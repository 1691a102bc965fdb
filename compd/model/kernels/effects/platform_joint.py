"""Kernels of the effects at the ports `platform_joint` and `revolute_axis`; see
`compd.model.library.platform_joint`."""

from __future__ import annotations

from compd.arrays import FloatArray
from compd.jit import helper
from compd.model.structures import EffectMachine, EffectRow

PPM = 1e-6
UM = 1e-3  # mm
URAD = 1e-6


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
def expansion(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    warming_K = quantities[0] - quantities[1]
    for i in range(row.links):
        for j in range(3):
            basis[3 * i + j, 0] = PPM * machine.platform_joints_P_mm[i, j] * warming_K


@helper
def axis_tilt(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    axes = machine.revolute_axes_P
    for i in range(machine.axes):  # z_P x e_i
        basis[3 * i, i] = -URAD * axes[i, 1]
        basis[3 * i + 1, i] = URAD * axes[i, 0]
