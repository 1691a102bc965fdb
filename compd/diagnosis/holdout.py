"""A sealed recording: looked at once, at the end, with what was learned elsewhere; nothing is fitted on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.compare import Comparison, compare
from compd.diagnosis.verdict import Diagnosis


@dataclass(frozen=True, eq=False)
class Holdout:
    """before, after : against the model as it was, and with the effects that the diagnosis found."""

    before: Comparison
    after: Comparison

    @property
    def said(self) -> str:
        """A sentence for a person."""
        return (
            f"Sealed until now, {self.after.aligned.recording.path}: {self.before.rms_um:.3g} um -> "
            f"{self.after.rms_um:.3g} um, {self.after.floor_ratio:.3g} times the noise squared (1 = nothing left)."
        )

    def as_json(self) -> dict[str, Any]:
        """Beside the verdict's own keys."""
        return {
            "recording": str(self.after.aligned.recording.path),
            "sha256": self.after.aligned.recording.sha256,
            "residual_rms_um": self.before.rms_um,
            "floor_ratio": self.before.floor_ratio,
            "final_rms_um": self.after.rms_um,
            "final_floor_ratio": self.after.floor_ratio,
        }


def opened(found: Diagnosis, aligned: AlignedRecording) -> Holdout:
    """The diagnosis on a recording that it has not seen. Raises CompdError where that lacks what an effect needs."""
    return Holdout(compare(aligned, found.before.fitted), compare(aligned, found.after.fitted))
