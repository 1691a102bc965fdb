"""Effects from block to block: what they remember goes on, and so does what the start of a session adds.

What an unknown state at the start of a session does (`compd.comparison.initial_states`) is the difference of two runs
of the effect, one of which began with that state greater by 1. Both are carried on from block to block.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np

from compd.arrays import FloatArray
from compd.model import Deltas, Memories, basis_deltas
from compd.model.effects import FittedEffect, Memory, Observations, evaluate_basis

# Array of an effect's memory, place in it, and the fitted number by which it acts.
StateKey: TypeAlias = tuple[int, int, int]


class CarriedState(NamedTuple):
    """After a block: the memories of effects, and those that began with a state greater by 1, by effect and state.

    `greater` has nothing of an effect before the first row of a session in which it is known.
    """

    memories: Memories
    greater: Mapping[str, Mapping[tuple[int, int], Memory]]


class EffectRows(NamedTuple):
    """What effects do in a block of N rows, each by the effect's id.

    bases : (N, sum of port sizes, P).  states : (N, sum of port sizes, K) what each unknown state at the start of the
    row's session adds, per unit; of effects with such states.
    """

    bases: Mapping[str, FloatArray]
    states: Mapping[str, FloatArray]

    def deltas(self, fitted: Sequence[FittedEffect], rows: Observations) -> dict[str, Deltas]:
        """What each effect adds at its ports, by its id."""
        return {effect.effect.id: basis_deltas(effect, rows, self.bases[effect.effect.id]) for effect in fitted}


NOTHING_CARRIED = CarriedState({}, {})


def advance_effects(
    fitted: Sequence[FittedEffect], rows: Observations, keys: Mapping[str, Sequence[StateKey]], before: CarriedState
) -> tuple[EffectRows, CarriedState]:
    """The effects in the rows that follow those of `before`, and what goes on to the next.

    keys : the K unknown states of each effect that has any, by its id.
    """
    bases: dict[str, FloatArray] = {}
    states: dict[str, FloatArray] = {}
    memories: dict[str, Memory] = {}
    greater: dict[str, Mapping[tuple[int, int], Memory]] = {}
    for effect in fitted:
        id_ = effect.effect.id
        bases[id_], memories[id_] = evaluate_basis(effect.effect, rows, effect.constants, before.memories.get(id_))
        if keys.get(id_):
            states[id_], greater[id_] = _advance_states(
                effect, rows, bases[id_], keys[id_], before.greater.get(id_, {})
            )
    return EffectRows(bases, states), CarriedState(memories, greater)


def _advance_states(
    fitted: FittedEffect,
    rows: Observations,
    basis: FloatArray,
    keys: Sequence[StateKey],
    greater: Mapping[tuple[int, int], Memory],
) -> tuple[FloatArray, Mapping[tuple[int, int], Memory]]:
    """(N, sum of port sizes, K) what each state adds, and the memories with greater states after the rows."""
    added = np.zeros((*basis.shape[:2], len(keys)))
    begins = np.unique([0, *np.flatnonzero(rows.session_start)])
    for first, end in zip(begins, [*begins[1:], len(rows)], strict=True):
        begin = int(first)
        if rows.session_start[begin]:
            greater = {}
        if not greater:
            known = np.isfinite(basis[begin:end]).all(axis=(1, 2))
            if not known.any():
                continue
            begin += int(np.argmax(known))
            greater = _greater_states(fitted, rows.select(slice(begin, begin + 1)), keys)
        part = rows.select(slice(begin, end))
        part = replace(part, session_start=np.zeros(len(part), dtype=bool))
        after: dict[tuple[int, int], Memory] = {}
        for state, memory in greater.items():
            moved, after[state] = evaluate_basis(fitted.effect, part, fitted.constants, memory)
            for k, (place, index, number) in enumerate(keys):
                if (place, index) == state:
                    added[begin:end, :, k] = moved[:, :, number] - basis[begin:end, :, number]
        greater = after
    return added, greater


def _greater_states(
    fitted: FittedEffect, row: Observations, keys: Sequence[StateKey]
) -> Mapping[tuple[int, int], Memory]:
    """The memory after the first row of a session, with each state greater by 1."""
    _, memory = evaluate_basis(fitted.effect, row, fitted.constants, None)
    assert memory is not None
    greater: dict[tuple[int, int], Memory] = {}
    for place, index, _ in keys:
        arrays = [array.copy() for array in memory]
        arrays[place][index] += 1.0
        greater[place, index] = tuple(arrays)
    return greater
