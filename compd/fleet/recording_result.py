"""Result of the examination of one recording, as plain data for other processes and a table."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime
from typing import Literal

Command = Literal["compare", "diagnose"]
# Verdicts of `compare`; those of `diagnose` are `compd.diagnosis.verdict.Verdict`.
AT_FLOOR, ABOVE_FLOOR, NOISE_NOT_KNOWN = "at_floor", "above_floor", "noise_not_known"

# The problem of a recording left undone for lack of time.
NOT_DONE = "was not done: Ctrl-C ended the work before"


@dataclass(frozen=True)
class FleetEstimate:
    """One parameter of one effect on one recording.

    Attributes
    ----------
    effect, parameter : as the effect's equation names it; with ``_1``, ``_x`` where there is one per link or axis.
    value, standard_error : in `unit`; a standard error that is not known is nan.
    p_value : probability that noise alone resembles the effect as much, corrected for all effects that were tried; nan
        for an effect that the model has already.
    plausible : whether the value lies in the range that the effect declares; None if not examined.
    rivals : effects that would explain this recording as well, in this one's place.
    """

    effect: str
    parameter: str
    value: float
    standard_error: float
    unit: str
    p_value: float = math.nan
    plausible: bool | None = None
    rivals: tuple[str, ...] = ()


@dataclass(frozen=True)
class RecordingResult:
    """An examined recording, or the problem that prevented it.

    Attributes
    ----------
    recording : its table's path.
    machine : name of its machine in the fleet; "" if nothing says which it is.
    kinematics : how that is built: "tripod_3spr", "hexapod_6ups", or "external"; "" with a problem.
    command : what was done.
    model : the model file that was applied; "" for none.
    started_at : when the campaign began, by the sidecar or by the name; None where neither says it.
    rows : rows that counted.
    error_unit : unit of the three numbers that follow; "um" but for recordings in another unit.
    rms_before_um : error per coordinate with the model as it is.
    rms_after_um : with the effects of `estimates`, fitted on this recording; nan where there are none.
    noise_floor_um : what noise alone would be; nan where it is not known.
    verdict : of `diagnose` its verdict; of `compare` AT_FLOOR, ABOVE_FLOOR or NOISE_NOT_KNOWN. "" with a problem.
    summary : the verdict in words.
    estimates : of the effects that were found, or that the model has.
    problem : why it could not be examined; "" if it was.
    basis : `Examination.basis`, the hash of what the result follows from; "" with a problem.
    """

    recording: str
    machine: str
    command: Command
    kinematics: str = ""
    model: str = ""
    started_at: datetime | None = None
    rows: int = 0
    error_unit: str = "um"
    rms_before_um: float = math.nan
    rms_after_um: float = math.nan
    noise_floor_um: float = math.nan
    verdict: str = ""
    summary: str = ""
    estimates: tuple[FleetEstimate, ...] = ()
    problem: str = ""
    basis: str = ""

    @property
    def not_done(self) -> bool:
        """Whether it has not been examined yet, so that no fault is known."""
        return NOT_DONE in self.problem

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of the effects of `estimates`, each once."""
        return tuple(dict.fromkeys(estimate.effect for estimate in self.estimates))
