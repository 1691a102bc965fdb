"""Examining one recording: which machine and model are its own, then `compare` or `diagnose`."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path

from compd.api.diagnosis import compare, diagnose
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.comparison import Comparison
from compd.comparison.open import open_recording
from compd.configuration import Configuration, load
from compd.diagnosis.model_changes import refit
from compd.errors import CompdError, Problem
from compd.files.atomic_files import file_stamp
from compd.fleet.recording_result import (
    ABOVE_FLOOR,
    AT_FLOOR,
    NOISE_NOT_KNOWN,
    Command,
    FleetEstimate,
    RecordingResult,
)
from compd.model_file.model_document import read_stored
from compd.model_file.model_file import ModelFile, read_model_file
from compd.recording.recording import Recording
from compd.recording.sidecar import read_sidecar

# Configurations, and models, that a process keeps: a fleet has hundreds of recordings of a few machines.
MOST_KEPT = 64


@dataclass(frozen=True)
class Examination:
    """What is done with each recording of a fleet; called with its path, in any process.

    Attributes
    ----------
    command : "compare" or "diagnose".
    machines : name of a machine -> the path of its configuration, for those that do not come with compd.
    models : name of a machine -> the path of its model file. Without one, no effect acts.
    effects : effects of one's own that a diagnosis tries, as `compd.load_effects` takes them.
    """

    command: Command
    machines: Mapping[str, Path]
    models: Mapping[str, Path]
    effects: tuple[str, ...] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that it needs beside the recordings."""
        return (*self.machines.values(), *self.models.values(), *map(Path, filter(os.path.isabs, self.effects)))

    def __call__(self, path: Path) -> RecordingResult:
        """Examine one recording. Raises CompdError where it cannot be."""
        machine = machine_name(path)
        file = self.machines.get(machine)
        aligned = open_recording(path, None if file is None else _configuration(file, file_stamp(file)))
        model = self._model(aligned)
        if self.command == "diagnose":
            return self._diagnosed(aligned, model)
        return self._compared(aligned, model)

    def _model(self, aligned: AlignedRecording) -> ModelFile | None:
        machine = aligned.recording.machine
        path = self.models.get(machine)
        return None if path is None else _model(path, file_stamp(path), machine, aligned.rows.links)

    def _compared(self, aligned: AlignedRecording, model: ModelFile | None) -> RecordingResult:
        """The recording beside the model, and the numbers that the model's effects would have on it."""
        comparison = compare(aligned, model)
        verdict = ABOVE_FLOOR if comparison.floor.known else NOISE_NOT_KNOWN
        estimates: list[FleetEstimate] = []
        after_um = math.nan
        if model is not None and model.fitted:
            refitted = refit(model, aligned)
            after_um = refitted.steps[-1].rms_after_um
            estimates = [
                FleetEstimate(number.effect, number.parameter, number.value, number.standard_error, number.unit)
                for number in refitted.numbers()
                if not number.searched
            ]
        return self._result(
            comparison, after_um, AT_FLOOR if comparison.at_floor else verdict, comparison.verdict, estimates
        )

    def _diagnosed(self, aligned: AlignedRecording, model: ModelFile | None) -> RecordingResult:
        diagnosis = diagnose(aligned, model, effects=self.effects)
        estimates = [
            FleetEstimate(
                step.effect.id,
                number.name,
                number.value,
                number.std,
                number.unit,
                step.p_value,
                number.plausible,
                tuple(rival.name for rival in step.rivals),
            )
            for step in diagnosis.steps
            for number in step.parameters
        ]
        after_um = diagnosis.after.rms_um if estimates else math.nan
        return self._result(diagnosis.before, after_um, diagnosis.verdict, diagnosis.summary, estimates)

    def _result(
        self, before: Comparison, after_um: float, verdict: str, summary: str, estimates: Sequence[FleetEstimate]
    ) -> RecordingResult:
        recording = before.aligned.recording
        return RecordingResult(
            recording=str(recording.path),
            machine=recording.machine,
            command=self.command,
            model=str(self.models.get(recording.machine, "")),
            started_at=_started_at(recording),
            rows=int(before.used.sum()),
            error_unit=before.aligned.unit,
            rms_before_um=before.rms_um,
            rms_after_um=after_um,
            noise_floor_um=before.floor.um if before.floor.known else math.nan,
            verdict=verdict,
            summary=summary,
            estimates=tuple(estimates),
        )


def examination(
    command: Command,
    machines: Sequence[str | Path] = (),
    models: Sequence[str | Path] = (),
    effects: Sequence[str | Path] = (),
) -> Examination:
    """What is to be done with each recording, its files checked before any work begins.

    Parameters
    ----------
    command : str
        ``"compare"`` or ``"diagnose"``.
    machines : sequence of path
        Configurations of machines that do not come with compd; each is for the recordings that name it.
    models : sequence of path
        Model files; each is for the recordings of its machine.
    effects : sequence of str or path
        Effects of one's own for `diagnose`, as `compd.load_effects` takes them.

    Raises
    ------
    CompdError
        With every problem of these files, and where two are for one machine.
    """
    problems: list[Problem] = []
    configurations = _by_machine(machines, lambda path: load(path).machine, "a configuration", problems)
    model_files = _by_machine(models, lambda path: read_stored(path).machine, "a model file", problems)
    if problems:
        raise CompdError(problems)
    return Examination(command, configurations, model_files, tuple(_wherever(effect) for effect in effects))


def machine_name(path: Path) -> str:
    """The machine that a recording's sidecar names; "" where it names none, or cannot be read."""
    try:
        sidecar = read_sidecar(path.with_suffix(".yaml"), [])
    except CompdError:
        return ""
    return "" if sidecar is None else sidecar.machine


def _by_machine(
    files: Sequence[str | Path], machine_of: Callable[[Path], str], kind: str, problems: list[Problem]
) -> dict[str, Path]:
    """Files by the machine that they are for; what cannot be read, or is the second for one machine, is a problem."""
    by_machine: dict[str, Path] = {}
    for path in dict.fromkeys(Path(file).absolute() for file in files):
        try:
            machine = machine_of(path)
        except CompdError as error:
            problems += error.problems
            continue
        if machine in by_machine:
            problems.append(
                Problem(
                    where=str(path),
                    what=f"is the second of its kind for machine {machine}",
                    value=f"the first is {by_machine[machine]}",
                    allowed=f"{kind} for each machine",
                    next_step="leave one of them out, or give each machine a name of its own (`machine:`)",
                )
            )
        by_machine.setdefault(machine, path)
    return by_machine


def _wherever(effects: str | Path) -> str:
    """A source of effects as a process in another directory finds it; a name stays a name."""
    return str(Path(effects).absolute()) if Path(effects).exists() else str(effects)


@lru_cache(MOST_KEPT)
def _configuration(path: Path, stamp: tuple[int, int] | None) -> Configuration:
    """The configuration; stamp : of the file, so that it is read again where that has changed."""
    return load(path)


@lru_cache(MOST_KEPT)
def _model(path: Path, stamp: tuple[int, int] | None, machine: str, links: int) -> ModelFile:
    """The model; stamp : of the file, so that it is read again where that has changed."""
    return read_model_file(path, machine, links)


def _started_at(recording: Recording) -> datetime | None:
    """When it began, UTC, as `compd record` writes it; None where the sidecar does not say."""
    try:
        began = datetime.fromisoformat(str(recording.sidecar.provenance.get("started_at")))
    except ValueError:
        return None
    return began.astimezone(UTC) if began.tzinfo else began.replace(tzinfo=UTC)
