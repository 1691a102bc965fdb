"""`compd machine release`: end the controller's role of any client."""

from __future__ import annotations

import typer

from compd.cli.options import DEFAULT_SOCKET, DaemonOption, daemon_address


def release(daemon: DaemonOption = DEFAULT_SOCKET) -> None:
    """Take the controller's role from the client that has it: the mode is cmm again until another sends a target."""
    from compd.client import connect

    with connect(daemon_address(daemon)) as client:
        client.release()
    typer.echo("no client is the controller any more; the mode is cmm")
