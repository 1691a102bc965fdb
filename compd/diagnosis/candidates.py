"""What may be missing from the model: effects of the library, or empirical terms, as columns of the prediction."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.diagnosis.criteria import Criteria
from compd.model.effect import ConstantValues, Effect
from compd.model.effect_needs import unmet_needs
from compd.units import UM_PER_MM


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect at one choice of its nonlinear constants.

    name : the effect's id, which variants of one effect share; of an empirical term, its covariate and form.
    columns_um : (N, m, P) by how many um each parameter moves the prediction.
    limits : (P, 2) plausible range of each parameter; infinite where nothing is known of it.
    searched_parameters : for how many parameters the search for its nonlinear constants counts.
    """

    name: str
    effect: Effect
    columns_um: FloatArray
    limits: FloatArray
    searched_parameters: int

    @property
    def largest(self) -> FloatArray:
        """(P,) the largest plausible size of each parameter."""
        return np.asarray(np.abs(self.limits).max(axis=1))

    @property
    def is_empirical(self) -> bool:
        """Whether it describes without naming a cause: no parameter has a plausible range."""
        return bool(np.isinf(self.limits).all())

    @property
    def parameter_count(self) -> int:
        """Fitted parameters, and what the search for constants counts for."""
        return int(self.columns_um.shape[2]) + self.searched_parameters

    def penalty_factor(self, criteria: Criteria) -> float:
        """How many times the gain of another effect it must gain to be believed."""
        if self.is_empirical:
            return criteria.description_factor
        return criteria.contradiction_factor if self.effect.registration else 1.0


@dataclass(frozen=True)
class CandidatePool:
    """Candidates, and the effects that this recording cannot test: id -> why."""

    candidates: tuple[Candidate, ...]
    untestable: Mapping[str, str] = field(default_factory=dict)


def library_pool(
    aligned: AlignedRecording, effects: Sequence[Effect], present: Collection[str], criteria: Criteria
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
        searched_parameters = sum(
            criteria.choice_parameters if constant.choice else criteria.searched_constant_parameters
            for constant in effect.constants
            if len({constants[constant.name] for constants in grid}) > 1
        )
        variants = [_candidate(effect, constants, aligned, searched_parameters) for constants in grid]
        reason = _reason_for_no_motion(variants, usable, criteria)
        if reason:
            untestable[effect.id] = reason
        else:
            candidates += variants
    return CandidatePool(tuple(candidates), untestable)


def _candidate(
    effect: Effect, constants: ConstantValues, aligned: AlignedRecording, searched_parameters: int
) -> Candidate:
    limits = np.array([column.parameter.theta_range for column in effect.columns(aligned.rows.links)])
    columns_um = aligned.columns(effect, constants) * UM_PER_MM
    return Candidate(effect.id, effect, columns_um, limits, searched_parameters)


def _missing_inputs(effect: Effect, aligned: AlignedRecording) -> str:
    """What the effect needs and the recording has not, in words; "" where it has everything."""
    if effect.registration and aligned.registered:
        return "fitted along in any case: the reference has a frame of its own"
    if aligned.model is None and effect.live:
        return "acts inside the machine, and of this machine only the model's prediction is known"
    return "; ".join(problem.what for problem in unmet_needs(effect, aligned.rows.available, aligned.rows.links))


def _reason_for_no_motion(variants: Sequence[Candidate], usable: BoolArray, criteria: Criteria) -> str:
    """Why none of an effect's variants moves the prediction on the usable rows; "" where one does."""
    columns_um = np.concatenate([variant.columns_um[usable] * variant.largest for variant in variants], axis=2)
    empty = float(np.mean(~np.isfinite(columns_um).all(axis=(1, 2))))
    if empty > criteria.most_empty:
        return f"what it needs is empty in {100 * empty:.0f} % of the rows"
    if np.nanmax(np.abs(columns_um), initial=0.0) < criteria.least_motion_um:
        return "what drives it stayed at its reference value: vary it"
    return ""
