"""`compd model adopt`: load a model file into the running daemon."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from compd.cli.options import DEFAULT_SOCKET, DaemonOption, daemon_address

# Timeout (s) of the answer: reading a model file takes a second, and an effect of one's own may import any library.
_TIMEOUT_S = 30.0

FileArgument = Annotated[
    Path | None, typer.Argument(metavar="FILE", help="The model file; default: print the daemon's present model.")
]
NoneOption = Annotated[bool, typer.Option("--none", help="No model file: the machine without effects, no shadow.")]


def adopt(file: FileArgument = None, daemon: DaemonOption = DEFAULT_SOCKET, none: NoneOption = False) -> None:
    """Load a model file into the running daemon; the correction slews to it."""
    typer.echo(ask_daemon(file, daemon, none, shadow=False)["kept_text"])


def ask_daemon(file: Path | None, daemon: str, none: bool, shadow: bool) -> dict[str, Any]:
    """Ask the daemon to load a model file, or with None for its present model; print and return its answer."""
    from compd.client import connect
    from compd.errors import DaemonError

    if none and file is not None:
        raise typer.BadParameter("name a model file, or --none")
    wanted = "" if none else file
    with connect(daemon_address(daemon), _TIMEOUT_S) as client:
        try:
            answer = client.model(wanted, shadow)
        except DaemonError as error:
            problems = [replace(problem, what=_with_hashes(problem.what)) for problem in error.problems]
            raise DaemonError(problems) from None
    typer.echo(f"applied: {_model_text(answer['applied'])}")
    for model in answer.values():
        for warning in model.get("warnings", ()) if isinstance(model, Mapping) else ():
            typer.echo(f"warning: {warning}", err=True)
    if "shadow" in answer:
        typer.echo(f"shadow:  {_model_text(answer['shadow'])}")
    return answer


def _with_hashes(text: str) -> str:
    """A refusal of the daemon, with the hash of each unlisted Python file in it that is readable here."""
    from compd.plugins import HASH_PLACE, hash_of_code

    def line(match: re.Match[str]) -> str:
        try:
            return f"{{file: {match['file']}, sha256: {hash_of_code(Path(match['file']))}}}"
        except OSError:
            return match[0]

    return re.sub(rf"\{{file: (?P<file>/.+?\.py), sha256: {HASH_PLACE}\}}", line, text)


def _model_text(model: Mapping[str, Any]) -> str:
    effects = ", ".join(model["effects"]) or "no effects"
    if "not_live" in model:
        effects += f" (at the reference instrument, not live: {', '.join(model['not_live'])})"
    if "from_20_degC" in model:
        effects += f" (from 20 degC and not from machine zero, fitted without it: {', '.join(model['from_20_degC'])})"
    return f"{model['file']} ({model['model']}): {effects}" if "file" in model else effects
