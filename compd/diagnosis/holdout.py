"""Holdout recordings: compared once, at the end, with what was learned elsewhere; nothing is fitted on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.comparison import AlignedRecording, Comparison, compare
from compd.diagnosis.little_effects import little_effects
from compd.diagnosis.verdict import Diagnosis
from compd.diagnosis.words.phrases import best_description, followed_text
from compd.diagnosis.words.summary import summary
from compd.errors import CompdError
from compd.model.effects import FittedEffect, needed_quantities
from compd.model.library import find_effect
from compd.text import join_words, nan_to_null


@dataclass(frozen=True, eq=False)
class HoldoutDescription:
    """What a diagnosis said that the rest follows, tried on a recording that took no part in it.

    name : what it follows, in words.
    rms_um : error with the description beside the effects, um; nan where it cannot be tried.
    holds : whether it lowers the error by its price.
    why_not : why it cannot be tried; "" where it was.
    """

    name: str
    rms_um: float = math.nan
    holds: bool = False
    why_not: str = ""


@dataclass(frozen=True, eq=False)
class Holdout:
    """A recording that took no part in a diagnosis.

    before, after : against the model as it was, and with the effects that the diagnosis found, parameters as fitted
        elsewhere.
    expected_um : between which errors it was to lie with 90 %, um; nan where that is not known.
    other_conditions : quantities that were elsewhere than in the recording of the diagnosis, in words: what is to be
        expected there is not known.
    described : what the rest followed in the diagnosis, tried here; None where it followed nothing.
    """

    before: Comparison
    after: Comparison
    expected_um: tuple[float, float] = (math.nan, math.nan)
    other_conditions: tuple[str, ...] = ()
    described: HoldoutDescription | None = None

    @property
    def summary(self) -> str:
        """The result in a sentence."""
        aligned = self.after.aligned
        return (
            f"Sealed until now, {aligned.recording.path}: {self.before.rms_um:.3g} -> {self.after.rms_um:.3g} "
            f"{aligned.unit}, {self.after.floor_ratio:.3g} times the noise squared (1 = nothing left). "
            f"Expected: {self._expected()}.{self._described()}"
        )

    def _expected(self) -> str:
        """What was to be expected, in words."""
        if self.other_conditions:
            return f"not known: other conditions ({'; '.join(self.other_conditions)})"
        low, high = self.expected_um
        return "not known" if math.isnan(low) else f"{low:.3g} to {high:.3g} {self.after.aligned.unit}, with 90 %"

    def _described(self) -> str:
        """Whether the description holds here, as a sentence behind others; "" without one."""
        if (found := self.described) is None:
            return ""
        if found.why_not:
            return f" What the rest followed, {found.name}, cannot be tried here: {found.why_not}."
        fall = f"{self.after.rms_um:.3g} -> {found.rms_um:.3g} {self.after.aligned.unit}"
        return f" What the rest followed, {found.name}, {'holds' if found.holds else 'does not hold'} here: {fall}."

    def as_json(self) -> dict[str, Any]:
        """One entry of `sealed`, beside the verdict's own keys."""
        return {
            "recording": str(self.after.aligned.recording.path),
            "sha256": self.after.aligned.recording.sha256,
            "residual_rms_um": self.before.rms_um,
            "floor_ratio": self.before.floor_ratio,
            "final_rms_um": self.after.rms_um,
            "final_floor_ratio": self.after.floor_ratio,
            "expected_um": None if self.other_conditions else nan_to_null(list(self.expected_um)),
            "other_conditions": list(self.other_conditions),
            **({} if self.described is None else {"described": nan_to_null(asdict(self.described))}),
        }


def evaluate_holdout(diagnosis: Diagnosis, aligned: AlignedRecording) -> Holdout:
    """Compare a holdout recording with the model before and after a diagnosis, by the same criteria.

    Raises CompdError where the recording lacks what an effect needs.
    """
    aligned = replace(aligned, criteria=diagnosis.before.criteria)
    before, after = (compare(aligned, comparison.fitted) for comparison in (diagnosis.before, diagnosis.after))
    conditions = _other_conditions(diagnosis, after)
    return Holdout(before, after, diagnosis.left_interval_um, conditions, _description(diagnosis, after))


def _description(diagnosis: Diagnosis, after: Comparison) -> HoldoutDescription | None:
    """What the rest follows best, with its numbers as fitted in the diagnosis; a change belongs to its own day.

    It holds where it lowers the logarithm of the mean square by its price, as in the diagnosis.
    """
    finding = best_description(diagnosis)
    if finding is None or not finding.formula_effects:
        return None
    name, links = followed_text(finding), after.aligned.rows.links
    fitted = []
    for declaration, values in zip(finding.formula_effects, finding.parameters, strict=True):
        effect = find_effect(declaration, "description")
        theta = np.array([values[column.name] for column in effect.columns(links)])
        fitted.append(FittedEffect(effect, theta, covariance=np.full((len(theta), len(theta)), np.nan)))
    needed = {need for each in fitted for need in needed_quantities(each.effect, links)}
    if missing := sorted(needed - set(after.aligned.rows.quantities)):
        return HoldoutDescription(name, why_not=f"{join_words(missing)} was not recorded")
    try:
        described = compare(after.aligned, [*after.fitted, *fitted], outlier=after.outlier)
    except CompdError as error:
        return HoldoutDescription(name, why_not=str(error))
    gain = 2.0 * math.log(after.rms_um / described.rms_um)
    return HoldoutDescription(name, described.rms_um, gain >= diagnosis.criteria.description_price)


def _other_conditions(diagnosis: Diagnosis, after: Comparison) -> tuple[str, ...]:
    """Places, and quantities by which the error goes, that are outside what the diagnosis has seen in many rows."""
    found, links = [], after.aligned.rows.links
    read = {name for fitted in diagnosis.after.fitted for name in needed_quantities(fitted.effect, links)}
    read |= {name for finding in diagnosis.depends_on[:1] for name in (finding.covariate, *finding.beside)}
    here, there = _conditions(diagnosis.after), _conditions(after)
    for name, values in there.items():
        if name not in read.union("xyz") or name not in here or not len(here[name]) or not len(values):
            continue
        low, high = float(here[name].min()), float(here[name].max())
        margin = diagnosis.criteria.range_slack * (high - low)
        outside = float(np.mean((values < low - margin) | (values > high + margin)))
        if outside > diagnosis.criteria.other_share:
            found.append(f"{name} was {low:.4g} to {high:.4g}, is {values.min():.4g} to {values.max():.4g}")
    return tuple(found)


def _conditions(comparison: Comparison) -> dict[str, FloatArray]:
    """By name what is known of the tip's place and of each measured quantity, on the rows that count."""
    rows, used = comparison.aligned.rows, comparison.used
    columns = {**dict(zip("xyz", rows.tip_M_mm.T, strict=True)), **rows.quantities}
    return {name: values[used & np.isfinite(values)] for name, values in columns.items()}


def evaluate_holdouts(diagnosis: Diagnosis, recordings: Sequence[AlignedRecording]) -> tuple[Diagnosis, list[Holdout]]:
    """Each holdout recording, and the diagnosis with what they say.

    It is identified where it was likely, and what it found brings one of them down to its noise; an effect that takes
    less than the noise leaves it there in any case.
    Raises CompdError as `evaluate_holdout` does.
    """
    holdouts = [evaluate_holdout(diagnosis, recording) for recording in recordings]
    tells = diagnosis.verdict == "likely" and not little_effects(diagnosis.steps, diagnosis.criteria)
    if tells and any(each.after.floor.known and each.after.at_floor for each in holdouts):
        diagnosis = replace(diagnosis, verdict="identified")
        diagnosis = replace(diagnosis, summary=summary(diagnosis))
    return diagnosis, holdouts
