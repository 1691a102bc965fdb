"""`compd doctor`: does this computer let the daemon do its work?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

_INSTALLED = Path("/etc/compd/machine.yaml")


def doctor(
    config: Annotated[
        Path | None,
        typer.Argument(help=f"The machine's configuration (YAML); {_INSTALLED} if left out, where there is one."),
    ] = None,
) -> None:
    """Look at what the daemon needs of this computer; end with what to do, in order.

    Ports and who holds them, rights, real time, latency of USB adapters, clock, disk, TCP port, the unit of systemd.
    Nothing is opened, written or asked that a running daemon could notice. Run it as the daemon's user. The exit code
    is 1 where something keeps the daemon from its work.
    """
    from rich.console import Console
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    from compd.commissioning import examine, is_fit, what_to_do
    from compd.machine_check import load_whole

    if config is None and _INSTALLED.exists():
        config = _INSTALLED
    findings = examine(None if config is None else load_whole(config))
    marks = {"GOOD": "", "UNKNOWN": "?", "ADVICE": "advice", "FAULT": "FAULT"}
    table = Table("", "what", "how it is", title=str(config or "this computer"), title_justify="left")
    for finding in findings:
        table.add_row(marks[finding.verdict.name], finding.subject, finding.what)
    console = Console()
    console.print(table)
    if steps := what_to_do(findings):
        console.print("What to do, in this order:")
        for number, step in enumerate(steps, start=1):
            console.print(Padding(Text(f"{number}. {step}"), (0, 0, 0, 2)))
    else:
        console.print("Nothing is to be done.")
    raise typer.Exit(0 if is_fit(findings) else 1)
