"""`compd recording`: what is in a recording, and can it be used?"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from compd.configuration import Configuration
    from compd.errors import Problem
    from compd.recording.recording import Recording

recording = typer.Typer(no_args_is_help=True, help="Recordings: readings of the machine beside a reference.")


@recording.callback()
def _recording() -> None:
    """Recordings: readings of the machine beside a reference."""


@recording.command()
def check(
    path: Annotated[Path, typer.Argument(help="The recording, NAME.csv, with NAME.yaml beside it.")],
    machine: Annotated[
        Path | None,
        typer.Option("--machine", help="The machine's configuration; one that comes with compd is found by its name."),
    ] = None,
) -> None:
    """Check a recording; report every problem at once, with file, row, column, value, what is allowed, next step."""
    found, _ = read_with_machine(path, machine, needs_reference=False)
    for warning in found.warnings:
        typer.echo(f"warning: {warning}")
    for line in _summary(found):
        typer.echo(line)


def read_with_machine(
    path: Path, machine: Path | None, needs_reference: bool = True
) -> tuple[Recording, Configuration | None]:
    """The recording, and the configuration of its machine: the one given, else the shipped one of its name.

    None for an external model. Raises RecordingError with the problems of both files and of the machine together.
    """
    from compd.errors import RecordingError
    from compd.recording.reader import read_recording

    problems: list[Problem] = []
    configuration = _configuration(path.with_suffix(".yaml"), machine, problems)
    try:
        found = read_recording(path, configuration, needs_reference)
    except RecordingError as error:
        raise RecordingError([*problems, *error.problems]) from error
    if problems:
        raise RecordingError(problems)
    return found, configuration


def _configuration(sidecar_path: Path, machine: Path | None, problems: list[Problem]) -> Configuration | None:
    from compd.configuration import load
    from compd.configuration.shipped import shipped_configuration
    from compd.errors import CompdError, Problem
    from compd.recording.sidecar import EXTERNAL, read_sidecar

    if machine is not None:
        return load(machine)
    reported_by_the_reader: list[Problem] = []
    sidecar = read_sidecar(sidecar_path, reported_by_the_reader)
    if sidecar is None or sidecar.machine in ("", EXTERNAL):
        return None
    # a name, not a path: `..` or `/` would leave the place where configurations are
    name = sidecar.machine if re.fullmatch(r"[\w-]+", sidecar.machine) else "-"
    try:
        shipped = shipped_configuration(f"{name}.yaml")
    except CompdError:
        problems.append(
            Problem(
                where=str(sidecar_path),
                what="no configuration of this machine comes with compd",
                value=repr(sidecar.machine),
                next_step="give it with --machine PATH, or mend `machine:` in the sidecar",
            )
        )
        return None
    return load(shipped)


def _summary(found: Recording) -> list[str]:
    """What a person wants to see before trusting a recording: sizes, reference, and every row that is not used."""
    gauges = [
        f"{values.shape[1]} {name}"
        for name, values in (
            ("scales", found.scale_mm),
            ("joint comparators", found.joint_mm),
            ("frame comparators", found.frame_mm),
        )
        if values is not None
    ]
    needed = (*found.gauge_columns, *found.reference_columns, *found.model_columns)
    usable = found.usable(needed)
    hours = (found.time_s[-1] - found.time_s[0]) / 3600.0
    lines = [
        f"{found.path}: {found.machine}, {found.rows} rows over {hours:.2f} h, {_sessions(found)}",
        f"    gauges: {', '.join(gauges) or 'none'}; {len(found.quantities)} other quantities; "
        f"approach {'recorded' if found.approach_measured else 'from the scales' if gauges else 'not known'}",
        f"    reference: {_reference(found)}",
        f"    {int(usable.mask.sum())} rows have all of these",
    ]
    lines += [f"    {count} rows left out: {why}" for why, count in {**found.left_out, **usable.left_out}.items()]
    reasons = dict.fromkeys(found.sidecar.excluded.values())
    lines += [f"    excluded: {reason}" for reason in reasons]
    return [*lines, f"    sha256 {found.sha256}"]


def _sessions(found: Recording) -> str:
    if found.session is None:
        return f"no sessions: {len(set(found.fold.tolist()))} blocks of time"
    return f"{len(set(found.session.tolist()))} sessions"


def _reference(found: Recording) -> str:
    reference = found.reference
    if reference is None:
        return "none yet; put an instrument's export beside it with `compd join`"
    parts = [reference.quantity, ", ".join(found.reference_columns)]
    if reference.quantity != "link_length":
        parts.append(f"in the {reference.frame}'s frame")
    sigma = ", ".join(f"{value:g}" for value in reference.sigma_um)
    parts.append("uncertainty not known" if sigma == "nan" else f"sigma {sigma} um")
    return "; ".join(parts)
