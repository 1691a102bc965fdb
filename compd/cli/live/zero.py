"""`compd zero`: take machine zero."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import typer

from compd.cli.options import DEFAULT_SOCKET, DaemonOption
from compd.units import UM_PER_MM

# Timeout (s) of the answer: the daemon averages the gauges for a second, and a slow disk takes time.
_TIMEOUT_S = 15.0
# Most gauges in the list; the others differ less.
_SHOWN = 9


def zero(
    daemon: DaemonOption = DEFAULT_SOCKET,
    yes: Annotated[
        bool, typer.Option("--yes", help="Do not ask about gauges that are distrusted or far from the previous zero.")
    ] = False,
) -> None:
    """Take machine zero: bring the machine to its zero position, let it stand still, then run this.

    A daemon that is about to start, and gauges that have no value yet, are waited for, for half a minute.
    """
    from compd.cli.waiting import connect_patiently, wait_for_gauges
    from compd.client import connect
    from compd.errors import DaemonError

    with connect_patiently(daemon, lambda path: connect(path, _TIMEOUT_S)) as client:
        wait_for_gauges(client)
        try:
            answer = client.zero(replace=yes)
        except DaemonError as error:
            if error.problems[0].value != "zero_differs":
                raise
            typer.echo(error.problems[0].what, err=True)
            typer.confirm("Is the machine at its zero position, and is this to be its zero (else --yes)?", abort=True)
            answer = client.zero(replace=True)
    typer.echo(f"machine zero taken at {answer['taken_at']} from {len(answer['readings_mm'])} gauges")
    if "without" in answer:
        typer.echo(f"without {', '.join(answer['without'])}, which could not be read: effects of these cannot be used")
    if "changed_mm" in answer:
        typer.echo(changes_text(answer["changed_mm"]))
    typer.echo(f"kept in {answer['path']}")


def changes_text(changed_mm: Mapping[str, float]) -> str:
    """Differences of the gauges from the previous machine zero: channel -> mm, the largest ones first."""
    largest = sorted(changed_mm, key=lambda channel: -abs(changed_mm[channel]))
    width = max(map(len, largest), default=0)
    lines = ["against the zero before, which is kept as machine-zero.json.old:"]
    lines += [f"  {channel:<{width}} {changed_mm[channel] * UM_PER_MM:+11.2f} um" for channel in largest[:_SHOWN]]
    if others := largest[_SHOWN:]:
        lines.append(f"  and {len(others)} others, up to {abs(changed_mm[others[0]]) * UM_PER_MM:.2f} um")
    return "\n".join(lines)
