"""What fitted effects add at the machine's ports: one effect, all effects, and their sum."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from compd.arrays import FloatArray
from compd.model.effects import Effect, FittedEffect, Memory, Observations, Port, evaluate_basis, port_size

# (N, size) per port, in mm (rad for directions).
Deltas: TypeAlias = dict[Port, FloatArray]
# By effect id.
Memories: TypeAlias = Mapping[str, Memory]


def split_by_port(effect: Effect, rows: Observations, values: NDArray[np.float64]) -> Deltas:
    """Split axis 1 of (N, sum of sizes, ...) into the effect's ports."""
    if len(effect.ports) == 1:
        return {effect.ports[0]: values}
    ends = np.cumsum([port_size(port, rows) for port in effect.ports])[:-1]
    return dict(zip(effect.ports, np.split(values, ends, axis=1), strict=True))


def effect_deltas(fitted: FittedEffect, rows: Observations, memory: Memory = None) -> tuple[Deltas, Memory]:
    """What one effect adds at its ports, basis @ theta: (N, size) each; and its memory after the rows."""
    basis, memory = evaluate_basis(fitted.effect, rows, fitted.constants, memory)
    # summed column by column: a matrix product may round differently for one row than for many
    total = np.zeros(basis.shape[:2])
    for column, value in enumerate(fitted.theta):
        total += basis[:, :, column] * value
    return split_by_port(fitted.effect, rows, total), memory


def deltas_by_effect(
    fitted: Sequence[FittedEffect], rows: Observations, memories: Memories
) -> tuple[dict[str, Deltas], dict[str, Memory]]:
    """What each effect adds, by id, and all memories after the rows. Begin with no memories: {}."""
    deltas: dict[str, Deltas] = {}
    after: dict[str, Memory] = {}
    for effect in fitted:
        id_ = effect.effect.id
        deltas[id_], after[id_] = effect_deltas(effect, rows, memories.get(id_))
    return deltas, after


def sum_deltas(summands: Collection[Deltas]) -> Deltas:
    """The sum of several effects at each port, added up in their order."""
    total: Deltas = {}
    for deltas in summands:
        for port, value in deltas.items():
            total[port] = total[port] + value if port in total else value
    return total
