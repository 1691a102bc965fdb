"""`compd adopt` and `compd shadow`: a model file into the running daemon."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from compd.cli.zero import DEFAULT_SOCKET, unix_address

# Reading a model file takes a second; an effect of a person's own may import what it likes.
_TIMEOUT_S = 30.0

FileArgument = Annotated[
    Path | None, typer.Argument(metavar="[FILE]", help="The model file; left out: tell what the daemon runs with.")
]
AddressOption = Annotated[
    str, typer.Option("--daemon", help="The daemon's Unix socket, or the configuration (YAML) that names it.")
]
NoneOption = Annotated[bool, typer.Option("--none", help="No model file: the machine without effects, no shadow.")]


def adopt(file: FileArgument = None, daemon: AddressOption = DEFAULT_SOCKET, none: NoneOption = False) -> None:
    """Let the running daemon use a model file: between two ticks, the correction slewing to the new one."""
    answer = _ask(file, daemon, none, shadow=False)
    if file is not None:
        typer.echo(
            f"until the daemon starts anew; to keep it, write `model_file: {answer['applied']['file']}` under `state:`"
        )


def shadow(file: FileArgument = None, daemon: AddressOption = DEFAULT_SOCKET, none: NoneOption = False) -> None:
    """Let the running daemon compute a model file's correction beside its own, and publish both; its own is applied."""
    _ask(file, daemon, none, shadow=True)


def _ask(file: Path | None, daemon: str, none: bool, shadow: bool) -> dict[str, Any]:
    from compd.client import connect

    if none and file is not None:
        raise typer.BadParameter("name a model file, or --none")
    # the daemon has another working directory
    wanted = "" if none else None if file is None else str(file.absolute())
    with connect(unix_address(daemon), _TIMEOUT_S) as client:
        answer = client.model(wanted, shadow)
    typer.echo(f"applied: {_told(answer['applied'])}")
    if "shadow" in answer:
        typer.echo(f"shadow:  {_told(answer['shadow'])}")
    return answer


def _told(model: Mapping[str, Any]) -> str:
    effects = ", ".join(model["effects"]) or "no effects"
    if "not_live" in model:
        effects += f" (at the reference instrument, not live: {', '.join(model['not_live'])})"
    return f"{model['file']} ({model['model']}): {effects}" if "file" in model else effects
