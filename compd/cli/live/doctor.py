"""`compd doctor`: check whether this computer is fit for the daemon."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

_INSTALLED = Path("/etc/compd/machine.yaml")


def doctor(
    config: Annotated[
        Path | None,
        typer.Argument(help=f"The machine's configuration (YAML); {_INSTALLED} by default, if it exists."),
    ] = None,
) -> None:
    """Check ports, permissions and real-time setup of this computer; list what to fix.

    It looks at ports and their owners, permissions, real time, latency of USB adapters, clock, disk, TCP port and the
    systemd unit, without disturbing a running daemon. Run it as the daemon's user. The exit code is 1 for a fault that
    stops the daemon.
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
