"""What a diagnosis says: the verdict, what was found, every candidate with its reason; as data and as words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from compd.comparison.compare import Comparison
from compd.diagnosis.empirical_search import EmpiricalFinding
from compd.diagnosis.rivals import Rival
from compd.diagnosis.selection import Number
from compd.json_text import nan_to_null
from compd.model.effect import Effect, FittedEffect

Verdict = Literal["adequate", "identified", "ambiguous", "unexplained", "not_testable"]
Status = Literal["explains", "partial", "no_gain", "not_testable"]


@dataclass(frozen=True, eq=False)
class DiagnosisStep:
    """One effect found.

    heldout_rms_um : with it and those before it.  explained_fraction : of what those before it left above the floor.
    shape : its searched constants are in `fitted`.
    """

    fitted: FittedEffect
    rivals: tuple[Rival, ...]
    heldout_rms_um: float
    explained_fraction: float
    p_adjusted: float
    numbers: tuple[Number, ...]

    @property
    def effect(self) -> Effect:
        """What acts."""
        return self.fitted.effect

    def as_json(self) -> dict[str, Any]:
        """Keys of the verdict's `steps`."""
        return {
            "effect": self.effect.id,
            "rivals": [one.name for one in self.rivals],
            "heldout_rms_um": self.heldout_rms_um,
            "explained_fraction": self.explained_fraction,
            "p_adjusted": self.p_adjusted,
            "parameters": [one.as_json() for one in self.numbers],
            "constants": dict(self.fitted.constants),
            "equation": self.effect.equation,
            "alike": {one.name: one.cosine for one in self.rivals},
        }


@dataclass(frozen=True, eq=False)
class CandidateResult:
    """One effect of the library, tried alone; nan where it could not be."""

    effect: str
    status: Status
    why: str
    heldout_rms_um: float = math.nan
    explained_fraction: float = math.nan
    p_adjusted: float = math.nan
    numbers: tuple[Number, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Keys of the verdict's `candidates`."""
        return {
            "effect": self.effect,
            "status": self.status,
            "why": self.why,
            "heldout_rms_um": self.heldout_rms_um,
            "explained_fraction": self.explained_fraction,
            "p_adjusted": self.p_adjusted,
            "parameters": [one.as_json() for one in self.numbers],
        }


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """before, after : the recording against the model as it was, and with the steps' effects.

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
        found: dict[str, Any] = {
            "verdict": self.verdict,
            "said": self.said,
            "recording": str(self.before.aligned.recording.path),
            "sha256": self.before.aligned.recording.sha256,
            "noise_floor_um": self.before.floor.um,
            "noise_floor_source": self.before.floor.source,
            "residual_rms_um": self.before.rms_um,
            "floor_ratio": self.before.floor_ratio,
            "steps": [one.as_json() for one in self.steps],
            "candidates": [one.as_json() for one in self.candidates],
            "depends_on": [one.as_json() for one in self.depends_on],
            "next_measurement": [dict(one) for one in self.next_measurement],
            "final_rms_um": self.after.rms_um,
            "final_floor_ratio": self.after.floor_ratio,
            "outlier_rows": self.after.aligned.recording.row[self.after.outlier].tolist(),
            "rows_used": int(self.after.used.sum()),
        }
        finite: dict[str, Any] = nan_to_null(found)
        return finite

    @property
    def said(self) -> str:
        """The verdict in one or two plain sentences."""
        floor = in_um(self.before.floor.um)
        noise = f"where noise alone is {floor}"
        before, after = in_um(self.before.rms_um), in_um(self.after.rms_um)
        error = f"the error of {before}"
        names = _listed([one.effect.id for one in self.steps])
        match self.verdict:
            case "adequate":
                return f"Nothing is missing: {error} is the measurement's own noise ({floor})."
            case "identified":
                with_them = "with it" if len(self.steps) == 1 else "with them"
                return f"What is missing is {names}: {with_them} {error} falls to {after}, {noise}."
            case "ambiguous":
                pairs = "; ".join(
                    f"{one.effect.id} or {_listed([rival.name for rival in one.rivals], 'or')}"
                    for one in self.steps
                    if one.rivals
                )
                return (
                    f"With {names} {error} falls to {after}, {noise}. But this recording cannot tell apart: "
                    f"{pairs}. The rows under 'next' can."
                )
            case "not_testable":
                return f"{_capital(error)} is above the noise of {floor}, but no effect can be tested on it."
        found = f"{_capital(names)} explains a part ({before} -> {after}). The rest" if self.steps else _capital(error)
        if not self.depends_on:
            return (
                f"{found} has no cause in the library and follows nothing that was measured: {after} are left, {noise}."
            )
        first = self.depends_on[0]
        follows = _listed([first.covariate, *first.beside])
        left = in_um(first.heldout_rms_um)
        return f"{found} has no cause in the library. It follows {follows}: to describe that leaves {left}, {noise}."


def in_um(value: float) -> str:
    """Two figures, and no powers of ten."""
    return f"{value:.0f} um" if value >= 100 else f"{value:.2g} um"


def _listed(names: Sequence[str], word: str = "and") -> str:
    return f" {word} ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
