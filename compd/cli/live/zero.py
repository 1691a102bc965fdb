"""`compd zero`: take machine zero."""

from __future__ import annotations

from typing import Annotated

import typer

from compd.cli.options import DEFAULT_SOCKET

# The daemon looks at the gauges for a second; a slow disk may take as long again.
_TIMEOUT_S = 15.0


def zero(
    address: Annotated[
        str, typer.Argument(help="The daemon's Unix socket, or the configuration (YAML) that names it.")
    ] = DEFAULT_SOCKET,
) -> None:
    """Take machine zero: bring the machine to its zero position, let it stand still, then run this.

    A daemon that is about to start, and gauges that have no value yet, are waited for, for half a minute.
    """
    from compd.cli.waiting import connect_patiently, wait_for_gauges
    from compd.client import connect

    with connect_patiently(address, lambda path: connect(path, _TIMEOUT_S)) as client:
        wait_for_gauges(client)
        answer = client.zero()
    typer.echo(f"machine zero taken at {answer['taken_at']} from {len(answer['readings_mm'])} gauges")
    typer.echo(f"kept in {answer['path']}")
