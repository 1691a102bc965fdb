"""`compd gauge poll`: poll an unresponsive gauge at once."""

from __future__ import annotations

import threading
from typing import Annotated, Any

import typer

from compd.cli.options import DEFAULT_SOCKET, DaemonOption, daemon_address

_TIMEOUT_S = 15.0
_LOOK_EVERY_S = 0.1


def poll(
    gauge: Annotated[str, typer.Argument(help="A gauge of the running machine, by its name in the configuration.")],
    daemon: DaemonOption = DEFAULT_SOCKET,
) -> None:
    """Poll an unresponsive gauge now and print the result."""
    from compd.client import connect
    from compd.clock import MonotonicClock

    clock, never = MonotonicClock(), threading.Event()
    with connect(daemon_address(daemon), _TIMEOUT_S) as client:
        before = gauge_status(client.status(), gauge)
        client.poll(gauge)
        end_s = clock.monotonic() + _TIMEOUT_S
        while clock.monotonic() < end_s:
            after = gauge_status(client.status(), gauge)
            if after.get("polls", 0) > before.get("polls", 0):
                typer.echo(f"{gauge}: {after['quality']} {after.get('detail', '')}".rstrip())
                raise typer.Exit(0 if after["quality"] == "ok" else 1)
            clock.wait(never, _LOOK_EVERY_S)
    typer.echo(f"{gauge}: not polled within {_TIMEOUT_S:g} s; `compd status` says how its line is doing", err=True)
    raise typer.Exit(1)


def gauge_status(status: dict[str, Any], gauge: str) -> dict[str, Any]:
    """A gauge's part of STATUS with its poll counts; empty if its line has none."""
    for line in status["lines"].values():
        if gauge in line["gauges"]:
            part: dict[str, Any] = line["gauges"][gauge]
            return part
    return {}
