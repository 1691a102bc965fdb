"""What the sample fixes for all rows: limits of outliers, the instrument's frame, states at the start of sessions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.alignment.aligned_recording import AlignedRecording, effect_deltas
from compd.comparison.comparison import Comparison
from compd.comparison.contributions import deltas_without
from compd.comparison.initial_states import InitialState, initial_states
from compd.comparison.nuisance import nuisance_parameters
from compd.comparison.outliers import OutlierLimits, outlier_limits
from compd.comparison.stream.carried_effects import EffectRows, StateKey
from compd.model.effects import FittedEffect
from compd.units import UM_PER_MM

# The whole model, among the names of what is switched off.
NOTHING = ""


class NuisanceTerms:
    """Nuisance terms of all rows, from their values on the sample.

    registration : (Q,) of the instrument's frame, or constants.
    states : (S, K) of each effect with unknown states, by its id: in each session each of its `keys`.
    """

    def __init__(self, registration: FloatArray, states: Mapping[str, FloatArray]) -> None:
        self.registration, self.states = registration, states

    def explained_um(self, columns: BlockNuisance) -> FloatArray:
        """(N, m) what they make of the residual."""
        total = columns.registration_um @ self.registration
        for id_, amounts in self.states.items():
            total = total + np.einsum("nmk,nk->nm", columns.states_um[id_], amounts[columns.session])
        return np.asarray(total)


@dataclass(frozen=True)
class BlockNuisance:
    """By how many um nuisance terms move a block of N rows.

    registration_um : (N, m, Q).  states_um : (N, m, K) by the effect's id.  session : (N,) place of the row's session.
    """

    registration_um: FloatArray
    states_um: Mapping[str, FloatArray]
    session: IntArray


@dataclass(frozen=True)
class FixedTerms:
    """What the sample fixes for all rows.

    limits : of outliers.  terms : nuisance terms of the whole model, under NOTHING, and without each source.
    keys : unknown states of each effect.  starts_s : (S,) when sessions start.
    """

    limits: OutlierLimits
    terms: Mapping[str, NuisanceTerms]
    keys: Mapping[str, Sequence[StateKey]]
    starts_s: FloatArray

    def block_nuisance(
        self, aligned: AlignedRecording, fitted: Sequence[FittedEffect], effects: EffectRows
    ) -> BlockNuisance:
        """The columns of a block."""
        return BlockNuisance(
            aligned.registration_columns * UM_PER_MM,
            {
                effect.effect.id: aligned.propagated(effect.effect, effects.states[effect.effect.id]) * UM_PER_MM
                for effect in fitted
                if effect.effect.id in effects.states
            },
            session_places(self.starts_s, aligned.recording.time_s),
        )


def session_places(starts_s: FloatArray, time_s: FloatArray) -> IntArray:
    """(N,) place of the session in which a row is."""
    return (np.searchsorted(starts_s, time_s, side="right") - 1).clip(0)


def fixed_terms(comparison: Comparison, starts_s: FloatArray) -> FixedTerms:
    """From the comparison of the sample.  starts_s : (S,) when the sessions of the whole recording start."""
    aligned, used = comparison.aligned, comparison.used
    known: BoolArray = np.asarray(np.isfinite(comparison.residual_um).all(axis=1))
    visit, conditions = aligned.recording.visit, aligned.conditions
    limits = outlier_limits(comparison.residual_um, known, visit, comparison.criteria, conditions)
    states = {
        effect.effect.id: initial_states(aligned.rows, effect.effect, effect.constants) for effect in comparison.fitted
    }
    keys = {id_: sorted({state.key for state in of_effect}) for id_, of_effect in states.items() if of_effect}
    sampled = session_places(starts_s, aligned.recording.time_s[aligned.rows.session_start])
    by_effect, total = effect_deltas(comparison.fitted, aligned.rows)
    terms: dict[str, NuisanceTerms] = {}
    for name, added in {NOTHING: total, **deltas_without(aligned, by_effect)}.items():
        residual_um = (aligned.measured_mm - aligned.predicted_mm(added)) * UM_PER_MM
        others = [effect for effect in comparison.fitted if effect.effect.id != name]
        rows = used & np.isfinite(residual_um).all(axis=1)
        theta = nuisance_parameters(aligned, others, residual_um, rows)
        count = aligned.registration_columns.shape[2]
        registration, theta = theta[:count], theta[count:]
        amounts: dict[str, FloatArray] = {}
        for effect in others:
            of_effect = states[effect.effect.id]
            if of_effect:
                own = keys[effect.effect.id]
                amounts[effect.effect.id] = _amounts(of_effect, theta[: len(of_effect)], own, sampled, len(starts_s))
            theta = theta[len(of_effect) :]
        terms[name] = NuisanceTerms(registration, amounts)
    return FixedTerms(limits, terms, keys, starts_s)


def _amounts(
    states: Sequence[InitialState], theta: FloatArray, keys: Sequence[StateKey], sampled: IntArray, sessions: int
) -> FloatArray:
    """(S, K) the states of each session; 0 of a session without a row in the sample.

    sampled : place among all sessions of each session of the sample.
    """
    amounts = np.zeros((sessions, len(keys)))
    for state, value in zip(states, theta, strict=True):
        amounts[sampled[state.session], keys.index(state.key)] = value
    return amounts
