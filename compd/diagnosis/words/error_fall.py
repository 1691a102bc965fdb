"""How far the error falls: before, after each effect, and the noise below which it cannot fall."""

from __future__ import annotations

import math
from dataclasses import dataclass

from compd.diagnosis.verdict import Diagnosis
from compd.text import fall_text, number_text, percent_text

CANNOT_KNOW = "how much of it is noise cannot be known"
# Where a floor is from, in words.
_SOURCES = {"repeats": "repeats", "declared": "declared"}


@dataclass(frozen=True)
class ErrorFall:
    """Errors per coordinate, rms, in the recording's `unit`; on rows that were left out wherever that is known.

    before, after : with the model as it was, and with all effects that were found.
    steps : with the first effect, with the first two, ...
    noise : the noise floor; nan where it is not known.  source : of the noise, in words.
    left_out : whether before and after are from rows that were left out.
    unknown : that the noise is not known, and what contradicts a declaration.
    """

    before: float
    steps: tuple[float, ...]
    after: float
    noise: float
    source: str
    unit: str
    left_out: bool
    unknown: str = CANNOT_KNOW

    @property
    def noise_known(self) -> bool:
        """Whether noise was measured or declared."""
        return not math.isnan(self.noise)

    @property
    def share(self) -> float:
        """Share of the squared error, above the noise where that is known, that is gone after all effects; 0 to 1."""
        return self.share_of(self.after)

    def share_of(self, left: float) -> float:
        """The same where an error `left` is left."""
        noise = self.noise if self.noise_known else 0.0
        whole = self.before**2 - noise**2
        return min(max((self.before**2 - left**2) / whole, 0.0), 1.0) if whole > 0 else math.nan

    def share_text(self, left: float) -> str:
        """ "73 % of the squared error above noise"."""
        return f"{percent_text(self.share_of(left))} of the squared error" + (
            " above noise" if self.noise_known else ""
        )

    def text(self, left: float) -> str:
        """ "105 -> 55 um", from the error as it was."""
        return fall_text([self.before, left], self.unit)

    @property
    def noise_text(self) -> str:
        """ "noise alone is 20 um"; "" where the noise is not known."""
        return f"noise alone is {number_text(self.noise, self.unit)}" if self.noise_known else ""


def error_fall(diagnosis: Diagnosis) -> ErrorFall:
    """The fall of the error in a diagnosis."""
    floor = diagnosis.before.floor
    steps = tuple(step.heldout_rms_um for step in diagnosis.steps)
    before, after = diagnosis.heldout_before_um, diagnosis.heldout_after_um
    left_out = math.isfinite(before) and math.isfinite(after)
    return ErrorFall(
        before=before if left_out else diagnosis.before.rms_um,
        steps=steps,
        after=after if left_out else diagnosis.after.rms_um,
        noise=math.nan if floor.source == "estimate" else floor.um,
        source=_SOURCES.get(floor.source, ""),
        unit=diagnosis.before.aligned.unit,
        left_out=left_out,
        unknown=_unknown(floor.um, floor.declared_um, diagnosis.before.aligned.unit),
    )


def _unknown(shown: float, declared: float, unit: str) -> str:
    """That the noise is not known; with what neighbouring rows show where that is not what is declared."""
    if math.isnan(declared):
        return CANNOT_KNOW
    return (
        f"{CANNOT_KNOW} ({number_text(declared, unit)} is declared, neighbouring rows scatter by "
        f"{number_text(shown, unit)})"
    )
