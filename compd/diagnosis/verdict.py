"""The verdict of a diagnosis with all its evidence, as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from compd.comparison import Comparison
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.findings import (
    CandidateResult,
    ConstantFinding,
    DiagnosisStep,
    EmpiricalFinding,
    GrossRows,
    ImplausibleEffect,
    UnknownStates,
    UntestedEffect,
)
from compd.diagnosis.little_effects import little_effects
from compd.diagnosis.named_probability import NamedProbability
from compd.result_tables import Columns, data_frame, html_table
from compd.text import nan_to_null

if TYPE_CHECKING:
    import pandas as pd

Verdict = Literal["adequate", "identified", "likely", "ambiguous", "partial", "unexplained", "not_testable"]
# Version of the words and keys of `Diagnosis.as_json`: 2 has the word `partial` and the key `constant`, 3 `likely`, 4
# `probability`, 5 the status `too_small`.
VERDICT_VERSION = 5


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis:
    """Which effects a model lacks, with the evidence.

    Attributes
    ----------
    verdict : str
        ``"adequate"``: nothing is missing. ``"identified"``: the effects of `steps` are what is missing.
        ``"likely"``: they explain it, but a thermal one was seen in one warm-up only, or `probability` is too small,
        or one takes less than the noise. Another session, a sealed recording or a second cycle of heating and cooling
        makes it identified; of what takes less than the noise, a recording in which it does more.
        ``"ambiguous"``: they explain it, but the recording cannot tell at least one of them from a rival.
        ``"partial"``: they explain a part; the rest is above the noise, or the noise is not known.
        ``"unexplained"``: no effect of the library gains; `depends_on` says what the error follows.
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
    constant : ConstantFinding or None
        A constant of the measured coordinates, which buys no verdict; None where there is none to report.
    gross : GrossRows
        Rows that nothing explains and that do not count.
    untested : tuple of UntestedEffect
        Effects that cannot be tried here; first those that may be behind what was found.
    asked : ImplausibleEffect or None
        The effect that explains the error best, and only with an implausible number; None where none is asked about.
    start : UnknownStates or None
        What is fitted along of a lag that was out of equilibrium when sessions began; None where nothing is.
    heldout_before_um : float
        Error on rows that were left out with the model as it was, without its constant, um per coordinate.
    heldout_after_um : float
        The same with the effects of `steps`.
    left_interval_um : tuple of float
        Between which errors another recording under the same conditions lies with 90 %, um per coordinate; nan where
        that is not known.
    probability_from : NamedProbability
        From which numbers `probability` is, or why none can be stated.
    criteria : Criteria
        The numbers on which it rests, each with unit, meaning and reason.
    summary : str
        The verdict in one or two sentences; `diagnose` fills it in last, from all the others.
    """

    verdict: Verdict
    before: Comparison
    after: Comparison
    steps: tuple[DiagnosisStep, ...]
    candidates: tuple[CandidateResult, ...]
    depends_on: tuple[EmpiricalFinding, ...]
    next_measurement: Sequence[Mapping[str, Any]] = field(default_factory=tuple)
    constant: ConstantFinding | None = None
    gross: GrossRows = field(default_factory=GrossRows)
    untested: tuple[UntestedEffect, ...] = ()
    asked: ImplausibleEffect | None = None
    start: UnknownStates | None = None
    heldout_before_um: float = float("nan")
    heldout_after_um: float = float("nan")
    left_interval_um: tuple[float, float] = (float("nan"), float("nan"))
    probability_from: NamedProbability = field(default_factory=NamedProbability)
    summary: str = ""
    criteria: Criteria = Criteria()

    @property
    def probability(self) -> float:
        """The probability that the effects of `steps` are all that has to be named, 0 to 1.

        A rival is not named; of effects that make a constant, any is right for any other. Without `steps` it is the
        probability that no effect of the library has to be named. nan where none can be stated: `probability_from`
        says why.
        """
        return self.probability_from.value

    def doubt_of(self, effect: str) -> str:
        """Why the recording does not support an effect, in the words of the verdict.

        ``""`` where the effect is named, nothing does as well in its place, and the named set is probable enough.

        Parameters
        ----------
        effect : str
            Its id.
        """
        said = f"{self.verdict.replace('_', ' ')}: {self.summary}"
        step = next((step for step in self.steps if step.effect.id == effect), None)
        if step is None:
            rival_of = [step.effect.id for step in self.steps if effect in [rival.name for rival in step.rivals]]
            place = f"these rows cannot tell {effect} from {rival_of[0]}" if rival_of else f"{effect} is not named"
            return f"{place}. {said}"
        if step.rivals:
            return f"these rows cannot tell {effect} from {step.rivals[0].name}. {said}"
        if not all(parameter.plausible for parameter in step.parameters):
            return f"{effect} needs an implausible number. {said}"
        if self.verdict == "likely" and effect in little_effects(self.steps, self.criteria):
            return f"{effect} takes less than the noise and may be something else. {said}"
        return "" if self.probability_from.confirms else f"{effect} may be something else. {said}"

    def to_dataframe(self) -> pd.DataFrame:
        """One row per effect of the library, as a pandas data frame.

        Returns
        -------
        pandas.DataFrame
            `effect`, its id; `found`, true where the diagnosis names it; `status`; `explained_fraction`, 0 to 1, and
            `heldout_rms_um`, um per coordinate, on rows that were left out, with the effect alone; `p_value`; `why`,
            the reason for the status in words. nan where an effect could not be tried; also as the share where only
            noise is left to explain.

        Raises
        ------
        CompdError
            Where pandas is not installed.
        """
        return data_frame(self._columns(self.candidates))

    def _repr_html_(self) -> str:
        tried = [candidate for candidate in self.candidates if candidate.status in ("explains", "partial")]
        unit = self.before.aligned.unit
        remarks = [
            f"{step.effect.id}: "
            + ", ".join(
                f"{number.name} = {number.value:.4g} ± {number.std:.2g} {number.unit}" for number in step.parameters
            )
            for step in self.steps
        ]
        remarks += [
            f"the rest follows {finding.covariate}: {finding.heldout_rms_um:.3g} {unit} are left with it"
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
            "version": VERDICT_VERSION,
            "said": self.summary,
            "recording": str(recording.path),
            "sha256": recording.sha256,
            "noise_floor_um": self.before.floor.um,
            "noise_floor_source": self.before.floor.source,
            "residual_rms_um": self.before.rms_um,
            "floor_ratio": self.before.floor_ratio,
            "heldout_before_um": self.heldout_before_um,
            "heldout_after_um": self.heldout_after_um,
            "left_interval_um": list(self.left_interval_um),
            **self.probability_from.as_json(),
            "constant": None if self.constant is None else self.constant.as_json(),
            "steps": [step.as_json() for step in self.steps],
            **({} if self.start is None else {"start": self.start.as_json()}),
            **({} if self.asked is None else {"asked": self.asked.as_json()}),
            "candidates": [candidate.as_json() for candidate in self.candidates],
            "depends_on": [finding.as_json() for finding in self.depends_on],
            "next_measurement": [dict(row) for row in self.next_measurement],
            "final_rms_um": self.after.rms_um,
            "final_floor_ratio": self.after.floor_ratio,
            "outlier_rows": self.after.aligned.recording.row[self.after.outlier].tolist(),
            **({"data_faults": [fault.text for fault in self.after.faults]} if self.after.faults else {}),
            "rows_used": int(self.after.used.sum()),
        }
        finite: dict[str, Any] = nan_to_null(data)
        return finite
