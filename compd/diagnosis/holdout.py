"""Holdout recordings: compared once, at the end, with what was learned elsewhere; nothing is fitted on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from compd.comparison import AlignedRecording, Comparison, compare
from compd.diagnosis.verdict import Diagnosis
from compd.diagnosis.words.summary import summary


@dataclass(frozen=True, eq=False)
class Holdout:
    """A recording that took no part in a diagnosis.

    before, after : against the model as it was, and with the effects that the diagnosis found, parameters as fitted
    elsewhere.
    """

    before: Comparison
    after: Comparison

    @property
    def summary(self) -> str:
        """The result in a sentence."""
        aligned = self.after.aligned
        return (
            f"Sealed until now, {aligned.recording.path}: {self.before.rms_um:.3g} -> {self.after.rms_um:.3g} "
            f"{aligned.unit}, {self.after.floor_ratio:.3g} times the noise squared (1 = nothing left)."
        )

    def as_json(self) -> dict[str, Any]:
        """One entry of `sealed`, beside the verdict's own keys."""
        return {
            "recording": str(self.after.aligned.recording.path),
            "sha256": self.after.aligned.recording.sha256,
            "residual_rms_um": self.before.rms_um,
            "floor_ratio": self.before.floor_ratio,
            "final_rms_um": self.after.rms_um,
            "final_floor_ratio": self.after.floor_ratio,
        }


def evaluate_holdout(diagnosis: Diagnosis, aligned: AlignedRecording) -> Holdout:
    """Compare a holdout recording with the model before and after a diagnosis, by the same criteria.

    Raises CompdError where the recording lacks what an effect needs.
    """
    aligned = replace(aligned, criteria=diagnosis.before.criteria)
    before, after = (compare(aligned, comparison.fitted) for comparison in (diagnosis.before, diagnosis.after))
    return Holdout(before, after)


def evaluate_holdouts(diagnosis: Diagnosis, recordings: Sequence[AlignedRecording]) -> tuple[Diagnosis, list[Holdout]]:
    """Each holdout recording, and the diagnosis with what they say.

    It is identified where it was likely, and what it found brings one of them down to its noise.
    Raises CompdError as `evaluate_holdout` does.
    """
    holdouts = [evaluate_holdout(diagnosis, recording) for recording in recordings]
    if diagnosis.verdict == "likely" and any(each.after.floor.known and each.after.at_floor for each in holdouts):
        diagnosis = replace(diagnosis, verdict="identified")
        diagnosis = replace(diagnosis, summary=summary(diagnosis))
    return diagnosis, holdouts
