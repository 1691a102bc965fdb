"""Waiting some seconds for what another terminal has just started: a configuration, a daemon, its gauges."""

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

# A simulated machine takes some seconds to start; a daemon that compiles its kernels half a minute on a slow computer.
PATIENCE_S = 30.0
_LOOK_EVERY_S = 0.2
# Good, or waiting for a person and not for time.
_SETTLED_QUALITIES = ("ok", "distrusted")
# No socket yet, or one on which nobody listens.
_NOT_YET = (FileNotFoundError, ConnectionRefusedError)


def wait_until(is_there: Callable[[], bool], missing: str, clock: Clock | None = None) -> bool:
    """Whether it is there within `PATIENCE_S`; where it is not at once, `missing` is said on standard error."""
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
    """Return when the file is there, or patience is over: whoever reads it says what is wrong."""
    wait_until(path.exists, f"{path} is not there yet", clock)


def connect_patiently(address: str, connect: Callable[[str], Client], clock: Clock | None = None) -> Client:
    """A connection to the daemon, which may be about to start.

    address : host:port, Unix socket, or the configuration that names one.  connect : as `compd.client.connect`.
    Raises DaemonError, ConfigurationError.
    """
    from compd.cli.options import unix_address

    if address.endswith((".yaml", ".yml")):
        wait_for_file(Path(address), clock)
    path = unix_address(address)
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
    """Return when no gauge is about to come, or patience is over: the daemon says what is wrong with it."""

    def not_good() -> list[str]:
        gauges = client.status()["gauges"]
        return [gauge["channel"] for gauge in gauges if gauge["quality"] not in _SETTLED_QUALITIES]

    if missing := not_good():
        others = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        verb = "have" if others else "has"
        wait_until(lambda: not not_good(), f"{missing[0]}{others} {verb} no value yet", clock)
