"""`compd sim fault`: break a line of the simulated machine, and mend it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compd.cli.paths import PathKind

NO_FAULT = "none"


def fault(
    simulation: Annotated[
        Path,
        typer.Argument(metavar="DIRECTORY", help="The directory that `compd sim run` runs in."),
        PathKind.FOLDER,
    ],
    line: Annotated[str | None, typer.Argument(help="The line's name in the configuration; default: list all.")] = None,
    kind: Annotated[
        str | None, typer.Argument(metavar="FAULT", help="unplugged, silent, late ...; none mends the line.")
    ] = None,
) -> None:
    """Break a line of the simulated machine, and mend it: unplugged, silent, garbled, late replies ...

    With DIRECTORY alone the lines are listed, with the fault of each and those that it can have.
    """
    from compd.errors import CompdError
    from compd.simulation import ControlClient

    with ControlClient(simulation / "control.sock") as machine:
        lines = machine.ask("LINES")["lines"]
        if line is None:
            for name, state in lines.items():
                typer.echo(f"{name}: {state['fault'] or 'works'}; can be {_quoted(state['faults'])}")
            return
        if line not in lines:
            raise CompdError.of("LINE", "is no line of this machine", value=line, allowed=", ".join(lines))
        faults = lines[line]["faults"]
        if kind not in (*faults, NO_FAULT):
            raise CompdError.of(
                "FAULT",
                f"is no fault of {line} can have" if kind else f"{line} needs one",
                value=kind or "",
                allowed=_quoted([*faults, NO_FAULT]),
            )
        machine.ask("FAULT", line=line, fault=None if kind == NO_FAULT else kind)
    typer.echo(f"{line}: {'works again' if kind == NO_FAULT else kind}")


def _quoted(names: list[str]) -> str:
    """Words quoted for a shell."""
    return ", ".join(f"'{name}'" if " " in name else name for name in names)
