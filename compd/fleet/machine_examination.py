"""Examination of one recording: finds its machine and model, then `compare` or `diagnose`."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from compd.api import compare, diagnose
from compd.comparison import AlignedRecording, Comparison, ComparisonCriteria, open_whole_or_sample
from compd.configuration import LINKS, Configuration, load
from compd.diagnosis import Criteria
from compd.errors import CompdError, Problem
from compd.files import file_stamp
from compd.fleet.fleet_recording import FleetRecording, content_hash
from compd.fleet.machine_names import PLACEHOLDER, machine_in, matches_of
from compd.fleet.recording_result import (
    ABOVE_FLOOR,
    AT_FLOOR,
    NOISE_NOT_KNOWN,
    Command,
    FleetEstimate,
    RecordingResult,
)
from compd.model.kinematics import ACTUATOR_KINDS
from compd.model_changes import refit_model
from compd.model_file import ModelFile, read_model_file, read_stored
from compd.recording import EXTERNAL
from compd.release import __version__


@dataclass(frozen=True)
class MachineFiles:
    """Files of one kind, each for a machine."""

    #: name of a configuration, as a sidecar has it -> the file for all machines that are built so
    by_configuration: Mapping[str, Path] = field(default_factory=dict)
    #: name of a machine of the fleet -> its own file, which comes first
    by_machine: Mapping[str, Path] = field(default_factory=dict)

    @property
    def paths(self) -> tuple[Path, ...]:
        """Every file."""
        return (*self.by_configuration.values(), *self.by_machine.values())

    def of(self, recording: FleetRecording) -> Path | None:
        """The file for a recording; None if there is none."""
        return self.by_machine.get(recording.machine) or self.by_configuration.get(recording.configuration)


def machine_files(
    places: Sequence[str | Path], machine_of: Callable[[Path], str], kind: str, problems: list[Problem]
) -> MachineFiles:
    """The matching files; a problem for each unreadable or missing one, and for a second one of a machine.

    places : files, or patterns: ``"machines/*.yaml"`` by the machine that each of them names,
        ``"models/{machine}.yaml"`` by the machine's name in the fleet.
    machine_of : the machine that a file names; raises CompdError where it cannot be read.
    kind : for messages: "a model file".
    """
    by_configuration: dict[str, Path] = {}
    by_machine: dict[str, Path] = {}
    for place in map(str, places):
        matches = [Path(place)] if Path(place).exists() else sorted(matches_of(place))
        # a name without wildcards is read in any case, to report its fault
        for path in matches or [Path(place)]:
            try:
                configuration = machine_of(path.absolute())
            except CompdError as error:
                problems += error.problems
                continue
            files, name = by_configuration, configuration
            if PLACEHOLDER in place:
                files, name = by_machine, machine_in(path, place)
            if files.setdefault(name, path.absolute()) != path.absolute():
                problems.append(_second(path, name, files[name], kind))
    return MachineFiles(by_configuration, by_machine)


def _second(path: Path, machine: str, first: Path, kind: str) -> Problem:
    return Problem(
        str(path),
        f"is the second of its kind for machine {machine}",
        value=f"the first is {first}",
        allowed=f"{kind} for each machine",
        next_step=f"leave one of them out; or, where machines that are built alike have one each, say which is whose: "
        f"'{path.parent}/{PLACEHOLDER}{path.suffix}'",
    )


# Most configurations, and models, in a process's cache: a fleet has hundreds of recordings of a few machines.
MAX_KEPT = 64
# number of links -> kinematics
KINEMATICS = {links: kinematics for kinematics, links in LINKS.items()}


@dataclass(frozen=True)
class Examination:
    """The examination of each recording of a fleet; called with it, in any process."""

    command: Command  #: "compare" or "diagnose"
    #: configurations of machines that do not come with compd
    machines: MachineFiles = field(default_factory=MachineFiles)
    models: MachineFiles = field(default_factory=MachineFiles)  #: model files. A machine without one has no effects.
    effects: tuple[str, ...] = ()  #: effects of one's own that a diagnosis tries, as `compd.load_effects` takes them.
    criteria: Criteria = Criteria()  #: numbers of the verdicts.  comparison : of the comparisons.
    comparison: ComparisonCriteria = ComparisonCriteria()

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file needed beside the recordings."""
        return (*self.machines.paths, *self.models.paths, *filter(Path.is_absolute, map(Path, self.effects)))

    def model_path(self, recording: FleetRecording) -> str:
        """The model file of a recording's machine; "" without one."""
        return str(self.models.of(recording) or "")

    def basis(self, recording: FleetRecording) -> str:
        """Hash of all inputs of its result besides the code: results with equal hashes are equal.

        The recording's files and its machine's name, the configuration, the model, effects of one's own, the command,
        the release, and the criteria where they are not its own. "" where a file cannot be read.
        """
        content = content_hash(recording.path)
        files = [self.machines.of(recording), self.models.of(recording), *self._effect_files]
        try:
            parts = [hashlib.sha256(path.read_bytes()).hexdigest() if path else "" for path in files]
        except OSError:
            return ""
        named = [effect for effect in self.effects if not Path(effect).is_absolute()]
        whole = [self.command, __version__, str(recording.path), recording.machine, str(recording.started_at), *named]
        whole += [repr(criteria) for criteria in (self.criteria, self.comparison) if criteria != type(criteria)()]
        return content and hashlib.sha256("\0".join([content, *parts, *whole]).encode()).hexdigest()

    def __call__(self, recording: FleetRecording) -> RecordingResult:
        """Examine one recording. Raises CompdError if that is impossible."""
        file = self.machines.of(recording)
        configuration = None if file is None else _configuration(file, file_stamp(file))
        aligned = open_whole_or_sample(recording.path, configuration, criteria=self.comparison)
        model = self._model(recording, aligned)
        if self.command == "diagnose":
            return self._diagnosed(recording, aligned, model)
        return self._compared(recording, aligned, model)

    @property
    def _effect_files(self) -> list[Path]:
        """The files of effects of one's own, those of directories one by one."""
        places = [Path(effect) for effect in self.effects if Path(effect).is_absolute()]
        return [
            file
            for place in places
            for file in (sorted(place.iterdir()) if place.is_dir() else [place])
            if file.is_file()
        ]

    def _model(self, recording: FleetRecording, aligned: AlignedRecording) -> ModelFile | None:
        path = self.models.of(recording)
        machine = aligned.recording.machine
        return None if path is None else _model(path, file_stamp(path), machine, aligned.rows.links)

    def _compared(
        self,
        recording: FleetRecording,
        aligned: AlignedRecording,
        model: ModelFile | None,
    ) -> RecordingResult:
        """The recording compared with the model, and the model's effects fitted on it."""
        comparison = compare(aligned, model)
        verdict = ABOVE_FLOOR if comparison.floor.known else NOISE_NOT_KNOWN
        estimates: list[FleetEstimate] = []
        after_um = math.nan
        if model is not None and model.fitted:
            refitted = refit_model(model, aligned, self.criteria)
            after_um = refitted.steps[-1].rms_after_um
            estimates = [
                FleetEstimate(number.effect, number.parameter, number.value, number.standard_error, number.unit)
                for number in refitted.numbers()
                if not number.searched
            ]
        if comparison.at_floor:
            verdict = AT_FLOOR
        return self._result(recording, comparison, after_um, verdict, comparison.verdict, estimates)

    def _diagnosed(
        self, recording: FleetRecording, aligned: AlignedRecording, model: ModelFile | None
    ) -> RecordingResult:
        diagnosis = diagnose(aligned, model, effects=self.effects, criteria=self.criteria)
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
        return self._result(recording, diagnosis.before, after_um, diagnosis.verdict, diagnosis.summary, estimates)

    def _result(
        self,
        recording: FleetRecording,
        before: Comparison,
        after_um: float,
        verdict: str,
        summary: str,
        estimates: Sequence[FleetEstimate],
    ) -> RecordingResult:
        return RecordingResult(
            recording=str(recording.path),
            machine=recording.machine,
            kinematics=_kinematics(before.aligned),
            command=self.command,
            model=self.model_path(recording),
            started_at=recording.started_at,
            rows=before.rows_used,
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
    criteria: Criteria = Criteria(),
    comparison: ComparisonCriteria = ComparisonCriteria(),
) -> Examination:
    """The examination of each recording, with its files checked before any work begins.

    Parameters
    ----------
    command : str
        ``"compare"`` or ``"diagnose"``.
    machines : sequence of path
        Configurations of machines that do not come with compd, for the recordings that name them; or patterns, as
        `machine_files` takes them.
    models : sequence of path
        Model files, for the recordings of their machines; or patterns.
    effects : sequence of str or path
        Effects of one's own for `diagnose`, as `compd.load_effects` takes them.
    criteria : Criteria
        Numbers of the verdicts, as for `compd.diagnose`.
    comparison : ComparisonCriteria
        Numbers of the comparisons, as for `compd.compare`.

    Raises
    ------
    CompdError
        With every problem of these files, and where two are for one machine.
    """
    problems: list[Problem] = []
    configurations = machine_files(machines, lambda path: load(path).machine, "a configuration", problems)
    model_files = machine_files(models, lambda path: read_stored(path).machine, "a model file", problems)
    if problems:
        raise CompdError(problems)
    own = tuple(_wherever(effect) for effect in effects)
    return Examination(command, configurations, model_files, own, criteria=criteria, comparison=comparison)


def _wherever(effects: str | Path) -> str:
    """A source of effects with an absolute path, for a process in another directory; a name stays a name."""
    return str(Path(effects).absolute()) if Path(effects).exists() else str(effects)


@lru_cache(MAX_KEPT)
def _configuration(path: Path, stamp: tuple[int, int] | None) -> Configuration:
    """The configuration; stamp : of the file, so that it is read again where that has changed."""
    return load(path)


@lru_cache(MAX_KEPT)
def _model(path: Path, stamp: tuple[int, int] | None, machine: str, links: int) -> ModelFile:
    """The model; stamp : of the file, so that it is read again where that has changed."""
    return read_model_file(path, machine, links)


def _kinematics(aligned: AlignedRecording) -> str:
    """The machine's kinematics by its configuration; EXTERNAL for a model of one's own."""
    model = aligned.model
    if model is None:
        return EXTERNAL
    drawn = model.extends_each and model.links in KINEMATICS and not model.hinges[:, 1].any()
    if drawn and model.actuators.fixed[:3].all():
        return KINEMATICS[model.links]
    kinds = sorted({ACTUATOR_KINDS[kind] for kind in model.actuators.kinds})
    return f"{model.links} rods, {model.scales} actuators: {', '.join(kinds)}"
