"""Waits some seconds for a start in another terminal: a configuration, a daemon, its gauges."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from compd.clock import Clock, MonotonicClock
from compd.errors import DaemonError

if TYPE_CHECKING:
    from compd.client import Client

# Longest wait (s): a simulated machine starts within seconds, a daemon that compiles its kernels takes half a minute on
# a slow computer.
PATIENCE_S = 30.0
_LOOK_EVERY_S = 0.2
# Qualities that end the wait: good, or waiting for a person.
_SETTLED_QUALITIES = ("ok", "distrusted")
# Errors before a start: no socket yet, or no listener on it.
_NOT_YET = (FileNotFoundError, ConnectionRefusedError)


def wait_until(is_there: Callable[[], bool], missing: str, clock: Clock | None = None) -> bool:
    """Whether it appears within `PATIENCE_S`; prints `missing` on standard error if it is not there at once."""
    if is_there():
        return True
    clock, never = clock or MonotonicClock(), threading.Event()
    typer.echo(f"{missing}: waiting up to {PATIENCE_S:.0f} s", err=True)
    end_s = clock.monotonic() + PATIENCE_S
    while clock.monotonic() < end_s:
        clock.wait(never, _LOOK_EVERY_S)
        if is_there():
            return True
    return False


def wait_for_file(path: Path, clock: Clock | None = None) -> None:
    """Return when the file exists, or patience is over; its reader then reports the fault."""
    wait_until(path.exists, f"{path} is not there yet", clock)


def connect_patiently(address: str, connect: Callable[[str], Client], clock: Clock | None = None) -> Client:
    """A connection to a daemon that may be starting.

    address : host:port, Unix socket, or the configuration that names one.  connect : as `compd.client.connect`.
    Raises DaemonError, ConfigurationError.
    """
    from compd.cli.options import daemon_address

    if address.endswith((".yaml", ".yml")):
        wait_for_file(Path(address), clock)
    path = daemon_address(address)
    clients: list[Client] = []

    def is_there() -> bool:
        try:
            clients.append(connect(path))
        except DaemonError as error:
            if not isinstance(error.__cause__, _NOT_YET):
                raise
        return bool(clients)

    if wait_until(is_there, f"{path}: no daemon answers yet", clock):
        return clients[0]
    return connect(path)


def wait_for_gauges(client: Client, clock: Clock | None = None) -> None:
    """Return when no gauge is expected any more, or patience is over; the daemon then reports the fault."""

    def not_good() -> list[str]:
        gauges = client.status()["gauges"]
        return [gauge["channel"] for gauge in gauges if gauge["quality"] not in _SETTLED_QUALITIES]

    if missing := not_good():
        others = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        verb = "have" if others else "has"
        wait_until(lambda: not not_good(), f"{missing[0]}{others} {verb} no value yet", clock)
