"""The result of a diagnosis: verdict, effects found, every candidate with its reason; as data and as words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from compd.comparison.compare import Comparison
from compd.json_text import nan_to_null
from compd.model.effect import Effect, FittedEffect
from compd.tables import Columns, data_frame, html_table

if TYPE_CHECKING:
    import pandas as pd

Verdict = Literal["adequate", "identified", "ambiguous", "unexplained", "not_testable"]
Status = Literal["explains", "partial", "no_gain", "not_testable"]


@dataclass(frozen=True)
class ParameterEstimate:
    """A fitted parameter in the unit that people read.

    Attributes
    ----------
    name : str
        As the effect's equation names it; with ``_1``, ``_x`` where there is one per link or axis.
    value : float
        The fitted value, in `unit`.
    std : float
        Its standard error, in `unit`.
    unit : str
        For instance ``"ppm/K"``.
    plausible : bool
        Whether the value lies in the range that the effect declares as plausible.
    """

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

    Attributes
    ----------
    member : int
        Its place among the candidates.
    name : str
        Id of the effect.
    cosine : float
        Similarity with the found effect on these rows, 0 to 1.
    excess : float
        By how much more it leaves, in squares of the noise floor.
    std : float
        Standard error of the excess.
    """

    member: int
    name: str
    cosine: float
    excess: float
    std: float


@dataclass(frozen=True)
class EmpiricalFinding:
    """One covariate that the residual follows without a known cause.

    Attributes
    ----------
    covariate : str
        What the residual follows: the column of a quantity, ``"time"``, a link's length ...
    form : str
        Of the term that describes it best, for instance ``"linear"``.
    port : str
        Where in the machine the term acts.
    p_value : float
        Probability of so strong a term by noise alone, corrected for all that were tried.
    explained_fraction : float
        Share of what is above the noise that it explains on rows that were left out, 0 to 1.
    heldout_rms_um : float
        Error on rows that were left out with the term, um per coordinate.
    formula_effects : tuple of dict
        The term as formulas that `add_effect` and `compd effect add` take, the largest direction first.
    parameters : tuple of dict
        Fitted values by name, one mapping for each of `formula_effects`.
    beside : tuple of str
        Other covariates that are needed along with it.
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

    Attributes
    ----------
    fitted : FittedEffect
        The effect with its fitted numbers and searched constants.
    rivals : tuple of Rival
        Effects that explain as much, best first; empty where the recording tells it from all others.
    heldout_rms_um : float
        Error on rows that were left out, with it and those before it, um per coordinate.
    explained_fraction : float
        Share of what those before it left above the noise floor, 0 to 1.
    p_value : float
        Probability of so high a score by noise alone, corrected for all effects that were tried.
    parameters : tuple of ParameterEstimate
        Its numbers with standard errors.
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

    Attributes
    ----------
    effect : str
        Its id.
    status : str
        ``"explains"``, ``"partial"``, ``"no_gain"`` or ``"not_testable"``.
    why : str
        The reason for the status, in words.
    heldout_rms_um : float
        Error on rows that were left out, with the effect alone, um per coordinate.
    explained_fraction : float
        Share of what is above the noise floor that it explains alone, 0 to 1.
    p_value : float
        Probability of so high a score by noise alone, corrected for all effects that were tried.
    parameters : tuple of ParameterEstimate
        Its numbers with standard errors.
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


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis:
    """Which effects a model lacks, with the evidence.

    Attributes
    ----------
    verdict : str
        ``"adequate"``: nothing is missing. ``"identified"``: the effects of `steps` are what is missing.
        ``"ambiguous"``: they explain it, but the recording cannot tell at least one of them from a rival.
        ``"unexplained"``: the library has no such cause; `depends_on` says what the error follows.
        ``"not_testable"``: the recording varies nothing by which an effect could be tested.
    before : Comparison
        The recording against the model as it was.
    after : Comparison
        The same against the model with the effects of `steps`.
    steps : tuple of DiagnosisStep
        The effects that were found, in the order in which they were taken.
    candidates : tuple of CandidateResult
        Every effect of the library with its status and the reason for it.
    depends_on : tuple of EmpiricalFinding
        What the rest follows, the strongest first: a description, not a cause.
    next_measurement : sequence of dict
        Rows of a plan where rivals are to be told apart; else what to vary, in words.
    """

    verdict: Verdict
    before: Comparison
    after: Comparison
    steps: tuple[DiagnosisStep, ...]
    candidates: tuple[CandidateResult, ...]
    depends_on: tuple[EmpiricalFinding, ...]
    next_measurement: Sequence[Mapping[str, Any]] = field(default_factory=tuple)

    def to_dataframe(self) -> pd.DataFrame:
        """One row per effect of the library, as a pandas data frame.

        Returns
        -------
        pandas.DataFrame
            `effect`, its id; `found`, true where the diagnosis names it; `status`; `explained_fraction`, 0 to 1, and
            `heldout_rms_um`, um per coordinate, on rows that were left out, with the effect alone; `p_value`; `why`,
            the reason for the status in words. nan where an effect could not be tried.

        Raises
        ------
        CompdError
            Where pandas is not installed.
        """
        return data_frame(self._columns(self.candidates))

    def _repr_html_(self) -> str:
        tried = [candidate for candidate in self.candidates if candidate.status in ("explains", "partial")]
        remarks = [
            f"{step.effect.id}: "
            + ", ".join(
                f"{number.name} = {number.value:.4g} ± {number.std:.2g} {number.unit}" for number in step.parameters
            )
            for step in self.steps
        ]
        remarks += [
            f"the rest follows {finding.covariate}: {finding.heldout_rms_um:.3g} um are left with it"
            for finding in self.depends_on[:1]
        ]
        others = len(self.candidates) - len(tried)
        remarks += [f"{others} effects without gain or not testable; to_dataframe() has them with the reason"]
        return html_table(f"{self.verdict}: {self.summary}", self._columns(tried), remarks)

    def __repr__(self) -> str:
        return f"<Diagnosis, {self.verdict}: {self.summary}>"

    def _columns(self, candidates: Sequence[CandidateResult]) -> Columns:
        found = {step.effect.id for step in self.steps}
        return {
            "effect": [candidate.effect for candidate in candidates],
            "found": [candidate.effect in found for candidate in candidates],
            "status": [candidate.status for candidate in candidates],
            "explained_fraction": [candidate.explained_fraction for candidate in candidates],
            "heldout_rms_um": [candidate.heldout_rms_um for candidate in candidates],
            "p_value": [candidate.p_value for candidate in candidates],
            "why": [candidate.why for candidate in candidates],
        }

    def as_json(self) -> dict[str, Any]:
        """What `compd diagnose --json` prints, as plain data; nan and inf are None."""
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
