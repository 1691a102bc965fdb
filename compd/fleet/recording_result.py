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
    """One parameter of one effect on one recording."""

    #: effect, parameter: as the effect's equation names it; with ``_1``, ``_x`` where there is one per link or axis
    effect: str
    parameter: str
    value: float  #: value, standard_error: in `unit`; a standard error that is not known is nan
    standard_error: float
    unit: str
    #: probability that noise alone resembles the effect as much, corrected for all effects that were tried; nan for an
    #: effect that the model has already
    p_value: float = math.nan
    plausible: bool | None = None  #: whether the value lies in the range that the effect declares; None if not examined
    rivals: tuple[str, ...] = ()  #: effects that would explain this recording as well, in this one's place


@dataclass(frozen=True)
class RecordingResult:
    """An examined recording, or the problem that prevented it."""

    recording: str  #: its table's path
    machine: str  #: name of its machine in the fleet; "" if nothing says which it is
    command: Command  #: what was done
    kinematics: str = ""  #: how that is built: "tripod_3spr", "hexapod_6ups", or "external"; "" with a problem
    model: str = ""  #: the model file that was applied; "" for none
    #: when the campaign began, by the sidecar or by the name; None where neither says it
    started_at: datetime | None = None
    rows: int = 0  #: rows that counted
    error_unit: str = "um"  #: unit of the three numbers that follow; "um" but for recordings in another unit
    rms_before_um: float = math.nan  #: error per coordinate with the model as it is
    #: with the effects of `estimates`, fitted on this recording; nan where there are none
    rms_after_um: float = math.nan
    noise_floor_um: float = math.nan  #: what noise alone would be; nan where it is not known
    #: of `diagnose` its verdict; of `compare` AT_FLOOR, ABOVE_FLOOR or NOISE_NOT_KNOWN. "" with a problem.
    verdict: str = ""
    summary: str = ""  #: the verdict in words
    estimates: tuple[FleetEstimate, ...] = ()  #: of the effects that were found, or that the model has
    problem: str = ""  #: why it could not be examined; "" if it was
    basis: str = ""  #: `Examination.basis`, the hash of what the result follows from; "" with a problem.

    @property
    def not_done(self) -> bool:
        """Whether it has not been examined yet, so that no fault is known."""
        return NOT_DONE in self.problem

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of the effects of `estimates`, each once."""
        return tuple(dict.fromkeys(estimate.effect for estimate in self.estimates))
