"""`compd adopt`: a model file into the running daemon."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from compd.cli.options import DEFAULT_SOCKET, DaemonOption, unix_address

# Reading a model file takes a second; an effect of a person's own may import what it likes.
_TIMEOUT_S = 30.0

FileArgument = Annotated[
    Path | None, typer.Argument(metavar="[FILE]", help="The model file; left out: tell what the daemon runs with.")
]
NoneOption = Annotated[bool, typer.Option("--none", help="No model file: the machine without effects, no shadow.")]


def adopt(file: FileArgument = None, daemon: DaemonOption = DEFAULT_SOCKET, none: NoneOption = False) -> None:
    """Let the running daemon use a model file: between two ticks, the correction slewing to the new one."""
    answer = ask_daemon(file, daemon, none, shadow=False)
    if file is not None:
        typer.echo(
            f"until the daemon starts anew; to keep it, write `model_file: {answer['applied']['file']}` under `state:`"
        )


def ask_daemon(file: Path | None, daemon: str, none: bool, shadow: bool) -> dict[str, Any]:
    """Ask the daemon to take a model file, or with None what it runs with; print and return its answer."""
    from compd.client import connect

    if none and file is not None:
        raise typer.BadParameter("name a model file, or --none")
    # the daemon has another working directory
    wanted = "" if none else None if file is None else str(file.absolute())
    with connect(unix_address(daemon), _TIMEOUT_S) as client:
        answer = client.model(wanted, shadow)
    typer.echo(f"applied: {_model_text(answer['applied'])}")
    if "shadow" in answer:
        typer.echo(f"shadow:  {_model_text(answer['shadow'])}")
    return answer


def _model_text(model: Mapping[str, Any]) -> str:
    effects = ", ".join(model["effects"]) or "no effects"
    if "not_live" in model:
        effects += f" (at the reference instrument, not live: {', '.join(model['not_live'])})"
    return f"{model['file']} ({model['model']}): {effects}" if "file" in model else effects
