"""`compd status`: health of the correction, for people and for monitoring."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from compd.cli.options import DEFAULT_SOCKET, DaemonOption, daemon_address


def status(
    daemon: DaemonOption = DEFAULT_SOCKET,
    timeout_s: Annotated[float, typer.Option("--timeout", min=0.1, help="Wait (s) for an answer.")] = 5.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the same and all of STATUS as JSON.")] = False,
) -> None:
    """Print state and reason of the daemon's setpoints, and the gauges that are not good.

    The exit code is that of monitoring plug-ins: 0 for state ok; 1, a warning, for another state in which setpoints are
    valid; 2, critical, for one in which they are not; 3 where no daemon answers, or the configuration cannot be read.
    """
    from compd.commissioning import DaemonStatus, Health, daemon_status
    from compd.errors import CompdError

    try:
        found = daemon_status(daemon_address(daemon), timeout_s)
    except CompdError as error:
        found = DaemonStatus(Health.UNKNOWN, daemon, "", str(error.problems[0]).replace("\n", " "))
    if as_json:
        typer.echo(json.dumps(found.to_json()))
    else:
        typer.echo(found.text)
        for gauge in found.gauges:
            typer.echo(f"    {gauge}")
        for clause in found.status.get("not_measured") or ():
            typer.echo(f"    not measured: {clause}")
    raise typer.Exit(int(found.health))
