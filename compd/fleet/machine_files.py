"""Configurations, or models, of a fleet's machines, by recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from compd.errors import CompdError, Problem
from compd.fleet.fleet_recording import FleetRecording
from compd.fleet.machine_names import PLACEHOLDER, machine_in, matches_of


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
