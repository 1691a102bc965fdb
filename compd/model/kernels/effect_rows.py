"""An effect's basis in N rows, each of which may need what the rows before it left behind."""

from __future__ import annotations

from typing import Any

from compd.arrays import FloatArray, IntArray
from compd.jit import COUNT, INDEX_ROWS, NUMBERS, ROW_MATRICES, ROWS, loop
from compd.model.kernels.effect_dispatch import set_basis
from compd.model.structures import EFFECT_MACHINE, EFFECT_ROWS


@loop([COUNT, EFFECT_ROWS, EFFECT_MACHINE, ROWS, INDEX_ROWS, NUMBERS, NUMBERS, ROW_MATRICES])
def basis_of_rows(
    number: int,
    rows: Any,
    machine: Any,
    quantities: FloatArray,
    code: IntArray,
    numbers: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """Fill basis (N, size, P), zero on entry; `memory` is that before the first row, and after the last.

    number, code, numbers : of the effect, see `compd.model.effects.effect.BasisProgram`.
    rows (N,), machine (1,) : structures of `compd.model.structures.effect_row`.
    quantities (N, 2 q) : those that the effect needs, then the same at machine zero; see
        `compd.model.kernels.effects`.
    """
    for k in range(rows.shape[0]):
        set_basis(number, rows[k], machine[0], quantities[k], code, numbers, memory, basis[k])
