"""The result of a diagnosis: verdict, effects found, every candidate with its reason; as data and as words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from compd.comparison.compare import Comparison
from compd.json_text import nan_to_null
from compd.model.effect import Effect, FittedEffect

Verdict = Literal["adequate", "identified", "ambiguous", "unexplained", "not_testable"]
Status = Literal["explains", "partial", "no_gain", "not_testable"]


@dataclass(frozen=True)
class ParameterEstimate:
    """A fitted parameter in the unit that people read, with its standard error."""

    name: str
    value: float
    std: float
    unit: str
    plausible: bool

    def as_json(self) -> dict[str, object]:
        """Keys of the verdict's `parameters`."""
        return {"name": self.name, "value": self.value, "std": self.std, "unit": self.unit, "plausible": self.plausible}


@dataclass(frozen=True)
class Rival:
    """An effect that explains the recording as well as one that was found, in its place.

    member : its place among the candidates.  cosine : with the found effect on these rows, 0 to 1.
    excess : by how much more it leaves, in squares of the noise floor.  std : standard error of that.
    """

    member: int
    name: str
    cosine: float
    excess: float
    std: float


@dataclass(frozen=True)
class EmpiricalFinding:
    """One covariate that the residual follows without a known cause.

    form, port : of the term that describes it best.
    explained_fraction : of what is above the noise, on rows that were left out.
    heldout_rms_um : error on rows that were left out, with the term.
    formula_effects : the term as declarations for `compd effect add`, the largest direction first.
    parameters : fitted values by name, one mapping for each of formula_effects.
    beside : other covariates that are needed along with it.
    """

    covariate: str
    form: str
    port: str
    p_value: float
    explained_fraction: float
    heldout_rms_um: float
    formula_effects: tuple[dict[str, Any], ...]
    parameters: tuple[dict[str, float], ...]
    beside: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Keys of the verdict's `depends_on`."""
        return {
            "covariate": self.covariate,
            "form": self.form,
            "port": self.port,
            "p_adjusted": self.p_value,
            "explained_fraction": self.explained_fraction,
            "heldout_rms_um": self.heldout_rms_um,
            "formula_effect": self.formula_effects[0],
            "formula_effects": list(self.formula_effects),
            "fitted": list(self.parameters),
            "beside": list(self.beside),
            "note": "a description, not a cause",
        }


@dataclass(frozen=True, eq=False)
class DiagnosisStep:
    """One effect that was found.

    fitted : the effect with its parameters and searched constants.  rivals : effects that explain as much, best first.
    heldout_rms_um : error on rows that were left out, with it and those before it.
    explained_fraction : of what those before it left above the noise floor.
    p_value : probability of so high a score by noise alone, corrected for all effects that were tried.
    """

    fitted: FittedEffect
    rivals: tuple[Rival, ...]
    heldout_rms_um: float
    explained_fraction: float
    p_value: float
    parameters: tuple[ParameterEstimate, ...]

    @property
    def effect(self) -> Effect:
        """The effect without its parameters."""
        return self.fitted.effect

    def as_json(self) -> dict[str, Any]:
        """Keys of the verdict's `steps`."""
        return {
            "effect": self.effect.id,
            "rivals": [rival.name for rival in self.rivals],
            "heldout_rms_um": self.heldout_rms_um,
            "explained_fraction": self.explained_fraction,
            "p_adjusted": self.p_value,
            "parameters": [parameter.as_json() for parameter in self.parameters],
            "constants": dict(self.fitted.constants),
            "equation": self.effect.equation,
            "alike": {rival.name: rival.cosine for rival in self.rivals},
        }


@dataclass(frozen=True, eq=False)
class CandidateResult:
    """One effect of the library, tried alone; nan where it could not be tried.

    effect : its id.  why : the reason for its status, in words.  The rest as in DiagnosisStep.
    """

    effect: str
    status: Status
    why: str
    heldout_rms_um: float = math.nan
    explained_fraction: float = math.nan
    p_value: float = math.nan
    parameters: tuple[ParameterEstimate, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Keys of the verdict's `candidates`."""
        return {
            "effect": self.effect,
            "status": self.status,
            "why": self.why,
            "heldout_rms_um": self.heldout_rms_um,
            "explained_fraction": self.explained_fraction,
            "p_adjusted": self.p_value,
            "parameters": [parameter.as_json() for parameter in self.parameters],
        }


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The result of `diagnose`.

    before, after : the recording against the model as it was, and with the effects of `steps`.
    depends_on : what the rest follows, the strongest first.
    next_measurement : rows of a plan where rivals are to be told apart; else what to vary, in words.
    """

    verdict: Verdict
    before: Comparison
    after: Comparison
    steps: tuple[DiagnosisStep, ...]
    candidates: tuple[CandidateResult, ...]
    depends_on: tuple[EmpiricalFinding, ...]
    next_measurement: Sequence[Mapping[str, Any]] = field(default_factory=tuple)

    def as_json(self) -> dict[str, Any]:
        """What `compd diagnose --json` prints; nan and inf are null."""
        recording = self.before.aligned.recording
        data: dict[str, Any] = {
            "verdict": self.verdict,
            "said": self.summary,
            "recording": str(recording.path),
            "sha256": recording.sha256,
            "noise_floor_um": self.before.floor.um,
            "noise_floor_source": self.before.floor.source,
            "residual_rms_um": self.before.rms_um,
            "floor_ratio": self.before.floor_ratio,
            "steps": [step.as_json() for step in self.steps],
            "candidates": [candidate.as_json() for candidate in self.candidates],
            "depends_on": [finding.as_json() for finding in self.depends_on],
            "next_measurement": [dict(row) for row in self.next_measurement],
            "final_rms_um": self.after.rms_um,
            "final_floor_ratio": self.after.floor_ratio,
            "outlier_rows": self.after.aligned.recording.row[self.after.outlier].tolist(),
            "rows_used": int(self.after.used.sum()),
        }
        finite: dict[str, Any] = nan_to_null(data)
        return finite

    @property
    def summary(self) -> str:
        """The verdict in one or two sentences."""
        floor = in_um(self.before.floor.um)
        noise = f"where noise alone is {floor}"
        before, after = in_um(self.before.rms_um), in_um(self.after.rms_um)
        error = f"the error of {before}"
        names = _joined([step.effect.id for step in self.steps])
        match self.verdict:
            case "adequate":
                return f"Nothing is missing: {error} is the measurement's own noise ({floor})."
            case "identified":
                with_them = "with it" if len(self.steps) == 1 else "with them"
                return f"What is missing is {names}: {with_them} {error} falls to {after}, {noise}."
            case "ambiguous":
                pairs = "; ".join(
                    f"{step.effect.id} or {_joined([rival.name for rival in step.rivals], 'or')}"
                    for step in self.steps
                    if step.rivals
                )
                return (
                    f"With {names} {error} falls to {after}, {noise}. But this recording cannot tell apart: "
                    f"{pairs}. The rows under 'next' can."
                )
            case "not_testable":
                return f"{_capitalized(error)} is above the noise of {floor}, but no effect can be tested on it."
        if self.steps:
            subject = f"{_capitalized(names)} explains a part ({before} -> {after}). The rest"
        else:
            subject = _capitalized(error)
        if not self.depends_on:
            return (
                f"{subject} has no cause in the library and follows nothing that was measured: {after} are left, "
                f"{noise}."
            )
        first = self.depends_on[0]
        follows = _joined([first.covariate, *first.beside])
        left = in_um(first.heldout_rms_um)
        return f"{subject} has no cause in the library. It follows {follows}: to describe that leaves {left}, {noise}."


def in_um(value: float) -> str:
    """A length with two figures and without powers of ten: "0.12 um"."""
    return f"{value:.0f} um" if value >= 100 else f"{value:.2g} um"


def _joined(names: Sequence[str], word: str = "and") -> str:
    return f" {word} ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)


def _capitalized(text: str) -> str:
    return text[:1].upper() + text[1:]
