"""What may be missing from the model: each effect of the library, or a description, as columns of the prediction."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.diagnosis.selection import CONTRADICTION_COSTS, DESCRIPTION_COSTS
from compd.model.effect import ConstantValues, Effect
from compd.model.effect_needs import unmet_needs
from compd.units import UM_PER_MM

# A candidate whose columns are unknown in more rows than this would cost all others those rows.
MOST_EMPTY = 0.1
# A column that moves the tip by less than this at the end of its plausible range does nothing on these rows.
LEAST_UM = 1e-3
# The best of ten values of a constant fits by chance as two fitted numbers do (log 10 = 2.3), of two values as one.
SEARCH_COUNTS = 2
CHOICE_COUNTS = 1


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect with one choice of its shape constants.

    name : the effect's id; variants of one effect share it.
    columns_um : (N, m, P) by how many um each fitted number moves the prediction.
    limits : (P, 2) plausible range of each fitted number; infinite where nothing is known of it.
    searched : how many fitted numbers the search for its shape constants is worth.
    """

    name: str
    effect: Effect
    shape: ConstantValues
    columns_um: FloatArray
    limits: FloatArray
    searched: int

    @property
    def largest(self) -> FloatArray:
        """(P,) the largest plausible size of each fitted number."""
        return np.asarray(np.abs(self.limits).max(axis=1))

    @property
    def described(self) -> bool:
        """Whether it is a description and no cause."""
        return bool(np.isinf(self.limits).all())

    @property
    def price(self) -> float:
        """By how much more than another effect it must explain to be believed."""
        if self.described:
            return DESCRIPTION_COSTS
        return CONTRADICTION_COSTS if self.effect.registration else 1.0

    @property
    def numbers(self) -> int:
        """How many numbers it takes to describe it."""
        return int(self.columns_um.shape[2]) + self.searched


@dataclass(frozen=True)
class Pool:
    """Candidates, and the effects that these rows cannot test: id -> why."""

    candidates: tuple[Candidate, ...]
    untestable: Mapping[str, str] = field(default_factory=dict)


def library_pool(aligned: AlignedRecording, effects: Sequence[Effect], present: Collection[str]) -> Pool:
    """Every effect that is not `present` in the model, at every choice of its shape constants."""
    found: list[Candidate] = []
    untestable: dict[str, str] = {}
    usable, _ = aligned.usable
    for effect in effects:
        if effect.id in present:
            continue
        why = _lacks(effect, aligned)
        if why:
            untestable[effect.id] = why
            continue
        shapes = effect.constant_grid(aligned.rows)
        searched = sum(
            CHOICE_COUNTS if constant.choice else SEARCH_COUNTS
            for constant in effect.constants
            if len({shape[constant.name] for shape in shapes}) > 1
        )
        variants = [_candidate(effect, shape, aligned, searched) for shape in shapes]
        why = _silent(variants, usable)
        if why:
            untestable[effect.id] = why
        else:
            found += variants
    return Pool(tuple(found), untestable)


def _candidate(effect: Effect, shape: ConstantValues, aligned: AlignedRecording, searched: int) -> Candidate:
    limits = np.array([column.parameter.theta_range for column in effect.columns(aligned.rows.links)])
    return Candidate(effect.id, effect, shape, aligned.columns(effect, shape) * UM_PER_MM, limits, searched)


def _lacks(effect: Effect, aligned: AlignedRecording) -> str:
    """What it needs and does not get, in words; "" where it has everything."""
    if effect.registration and aligned.registered:
        return "fitted along in any case: the reference has a frame of its own"
    if aligned.model is None and effect.live:
        return "acts inside the machine, and of this machine only the model's prediction is known"
    return "; ".join(problem.what for problem in unmet_needs(effect, aligned.rows.available, aligned.rows.links))


def _silent(variants: Sequence[Candidate], usable: BoolArray) -> str:
    """Why none of an effect's variants does anything on the usable rows; "" where one does."""
    columns = np.concatenate([one.columns_um[usable] * one.largest for one in variants], axis=2)
    empty = float(np.mean(~np.isfinite(columns).all(axis=(1, 2))))
    if empty > MOST_EMPTY:
        return f"what it needs is empty in {100 * empty:.0f} % of the rows"
    if np.nanmax(np.abs(columns), initial=0.0) < LEAST_UM:
        return "what drives it stayed at its reference value: vary it"
    return ""
