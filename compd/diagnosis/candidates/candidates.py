"""What may be missing from the model: effects of the library, a constant, descriptions, changes in time; as columns."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison import AlignedRecording, promising_constants, told_periods
from compd.diagnosis.candidate_criteria import CandidateCriteria
from compd.diagnosis.criteria import Criteria
from compd.model.effects import ConstantValues, Effect, unmet_needs
from compd.units import UM_PER_MM

Kind: TypeAlias = Literal["effect", "proxy", "constant", "description", "change"]


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect at one choice of its nonlinear constants.

    name : the effect's id, which variants of one effect share; of a description, its covariate and form.
    columns_um : (N, m, P) by how many um each parameter moves the prediction.
    limits : (P, 2) plausible range of each parameter; infinite where nothing is known of it.
    searched_parameters : for how many parameters the search for its nonlinear constants counts.
    best_of : among how many choices of its constants, unlike one another, the residual itself chose this one; 1 where
        it was chosen without looking at the residual.
    constants : values of its nonlinear constants.
    rough : of each parameter, whether its range follows from a stated tolerance; empty where none does.
    kind : "effect" names a cause; "proxy" stands for one that was not measured; the others name none.
    """

    name: str
    effect: Effect
    columns_um: FloatArray
    limits: FloatArray
    searched_parameters: int
    constants: ConstantValues = field(default_factory=dict)
    kind: Kind = "effect"
    best_of: int = field(default=1, kw_only=True)
    rough: tuple[bool, ...] = field(default=(), kw_only=True)

    @property
    def largest(self) -> FloatArray:
        """(P,) the largest plausible size of each parameter."""
        return np.asarray(np.abs(self.limits).max(axis=1))

    def allowed(self, rough_factor: float) -> FloatArray:
        """(P, 2) limits beyond which the candidate explains nothing: those that a stated tolerance gives, widened."""
        return self.limits * np.where(self.rough, rough_factor, 1.0)[:, None] if self.rough else self.limits

    @property
    def parameter_count(self) -> int:
        """Fitted parameters, and what the search for constants counts for."""
        return int(self.columns_um.shape[2]) + self.searched_parameters

    def price(self, criteria: Criteria) -> float:
        """By how much it must lower the logarithm of the loss, with the price of its further numbers."""
        of_kind = criteria.description_price if self.kind in ("description", "change") else criteria.effect_price
        return of_kind + criteria.number_price * (self.parameter_count - 1)


@dataclass(frozen=True)
class CandidatePool:
    """Candidates, and the effects that this recording cannot test: id -> why; some of them with a proxy."""

    candidates: tuple[Candidate, ...]
    untestable: Mapping[str, str] = field(default_factory=dict)
    proxies: tuple[Candidate, ...] = ()


def library_pool(
    aligned: AlignedRecording,
    effects: Sequence[Effect],
    present: Collection[str],
    criteria: CandidateCriteria = CandidateCriteria(),
) -> CandidatePool:
    """Every effect at every choice of its nonlinear constants, except those whose ids are `present` in the model."""
    candidates: list[Candidate] = []
    untestable: dict[str, str] = {}
    usable = aligned.usable.mask
    for effect in effects:
        if effect.id in present:
            continue
        reason = _missing_inputs(effect, aligned)
        if reason:
            untestable[effect.id] = reason
            continue
        grid = effect.constant_grid(aligned.rows)
        searched, seen = searched_parameters(effect, grid, criteria), _seen_to_repeat(effect, grid, aligned)
        if not seen:
            untestable[effect.id] = "the rows cover less than one period of it: measure over a longer way"
            continue
        variants = [variant(effect, constants, aligned, searched) for constants in seen]
        reason = _reason_for_no_motion(variants, usable, criteria)
        if reason:
            untestable[effect.id] = reason
        else:
            candidates += variants
    return CandidatePool(tuple(candidates), untestable)


def periodic_candidates(
    aligned: AlignedRecording, effects: Iterable[Effect], residual_um: FloatArray, rows: BoolArray
) -> list[Candidate]:
    """Effects with a period, at the periods that a residual suggests.

    residual_um : (N, m).  rows : (N,) those that count.
    """
    candidates = []
    for effect in effects:
        promising = promising_constants(effect, aligned, residual_um, rows)
        candidates += [
            replace(variant(effect, constants, aligned, promising.searched_parameters), best_of=promising.independent)
            for constants in promising.constants
        ]
    return candidates


def _seen_to_repeat(
    effect: Effect, grid: Sequence[dict[str, float]], aligned: AlignedRecording
) -> Sequence[dict[str, float]]:
    """Values of the nonlinear constants without the searched periods that the rows cannot tell from others."""
    for constant in effect.constants:
        if constant.period_of and len({constants[constant.name] for constants in grid}) > 1:
            shortest, longest = told_periods(effect, constant, aligned)
            grid = [constants for constants in grid if shortest <= constants[constant.name] <= longest]
    return grid


def searched_parameters(effect: Effect, grid: Sequence[ConstantValues], criteria: CandidateCriteria) -> int:
    """For how many parameters the search of an effect's constants over a grid counts."""
    return sum(
        criteria.searched_choice if constant.choice else criteria.searched_constant
        for constant in effect.constants
        if len({constants[constant.name] for constants in grid}) > 1
    )


def variant(effect: Effect, constants: ConstantValues, aligned: AlignedRecording, searched: int) -> Candidate:
    """The effect at one choice of its constants; searched : for how many parameters their search counts."""
    parameters = [column.parameter for column in effect.columns(aligned.rows.links)]
    limits = np.array([parameter.theta_range for parameter in parameters])
    rough = tuple(parameter.rough for parameter in parameters)
    columns_um = aligned.columns(effect, constants) * UM_PER_MM
    return Candidate(effect.id, effect, columns_um, limits, searched, constants, rough=rough if any(rough) else ())


def _missing_inputs(effect: Effect, aligned: AlignedRecording) -> str:
    """What the effect needs and the recording has not, in words; "" where it has everything."""
    if effect.registration and aligned.ends is not None:
        return "fitted along in any case: nobody knows where the fixed balls or pins are"
    if effect.registration and aligned.registered:
        return "fitted along in any case: the reference has a frame of its own"
    return "; ".join(
        problem.what
        for problem in unmet_needs(effect, aligned.rows.available, aligned.rows.links, aligned.rows.quantities_at_zero)
    )


def _reason_for_no_motion(variants: Sequence[Candidate], usable: BoolArray, criteria: CandidateCriteria) -> str:
    """Why none of an effect's variants moves the prediction on the usable rows; "" where one does."""
    columns_um = np.concatenate([variant.columns_um[usable] * variant.largest for variant in variants], axis=2)
    empty = float(np.mean(~np.isfinite(columns_um).all(axis=(1, 2))))
    if empty > criteria.max_empty_share:
        return f"what it needs is empty in {100 * empty:.0f} % of the rows"
    if np.nanmax(np.abs(columns_um), initial=0.0) < criteria.min_motion_um:
        return "what drives it stayed at its reference value: vary it"
    return ""
