"""`compd recording`: what is in a recording, and can it be used?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from compd.configuration import Configuration
    from compd.workbench.recording import Recording

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
    from compd.workbench.reader import read_recording

    found = read_recording(path, _configuration(path, machine), needs_reference=False)
    for warning in found.warnings:
        typer.echo(f"warning: {warning}")
    for line in _summary(found):
        typer.echo(line)


def _configuration(path: Path, machine: Path | None) -> Configuration | None:
    """The configuration given, or the shipped one that the sidecar names; None for an external model."""
    from compd.configuration import load
    from compd.errors import Problem, RecordingError
    from compd.shipped import shipped_machines
    from compd.workbench.sidecar import EXTERNAL, read_sidecar

    if machine is not None:
        return load(machine)
    ignored: list[Problem] = []  # the reader reports them again, with everything else
    sidecar = read_sidecar(path.with_suffix(".yaml"), ignored)
    if sidecar is None or sidecar.machine in ("", EXTERNAL):
        return None
    return None


def _summary(found: Recording) -> list[str]:
    return [str(found.rows)]
