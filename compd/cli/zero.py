"""`compd zero`: take machine zero."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

DEFAULT_SOCKET = "/run/compd/compd.sock"
# The daemon looks at the gauges for a second; a slow disk may take as long again.
_TIMEOUT_S = 15.0


def zero(
    address: Annotated[
        str, typer.Argument(help="The daemon's Unix socket, or the configuration (YAML) that names it.")
    ] = DEFAULT_SOCKET,
) -> None:
    """Take machine zero: bring the machine to its zero position, let it stand still, then run this."""
    from compd.client import connect

    with connect(unix_address(address), _TIMEOUT_S) as client:
        answer = client.zero()
    typer.echo(f"machine zero taken at {answer['taken_at']} from {len(answer['readings_mm'])} gauges")
    typer.echo(f"kept in {answer['path']}")


def unix_address(address: str) -> str:
    """An address as it is; for a configuration file, the Unix socket that it names."""
    if not address.endswith((".yaml", ".yml")):
        return address
    from compd.configuration import load

    return load(Path(address)).sockets.unix.path
