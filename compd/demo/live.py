"""The simulated machine, the daemon and the page, until Ctrl-C: `make live`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from compd.client import connect
from compd.configuration import Configuration
from compd.demo.session import wait_for_gauges
from compd.demo.simulated_daemon import simulated_daemon
from compd.errors import DaemonError

# Speed-up of weather and warm-up: an hour in three minutes makes the motion visible.
LIVE_SPEEDUP = 20.0
# Time (s) at machine zero, in which zero is taken.
ZERO_HOLD_S = 30.0
ANSWER_TIMEOUT_S = 15.0
WATCH_HZ = 10.0
ZERO_TRIES = 3


def run_live(configuration: Configuration, seed: int, serve: Callable[[str], None]) -> None:
    """Start the simulated machine and its daemon, take machine zero, and `serve`; stop both when that returns.

    serve : called with the daemon's Unix socket; returns when a person has had enough.
    Raises DaemonError if one does not start.
    """
    with simulated_daemon(configuration, seed, LIVE_SPEEDUP, ZERO_HOLD_S) as directory:
        take_zero(directory / "compd.sock")
        serve(str(directory / "compd.sock"))


def take_zero(unix_socket: Path) -> None:
    """Take machine zero of a daemon as soon as every gauge is good. Raises DaemonError after three refusals."""
    with connect(unix_socket, ANSWER_TIMEOUT_S) as observer, connect(unix_socket, ANSWER_TIMEOUT_S) as daemon:
        setpoints = daemon.watch(WATCH_HZ)
        for tries_left in reversed(range(ZERO_TRIES)):
            wait_for_gauges(observer, setpoints)
            try:
                observer.zero()
                return
            except DaemonError:  # a gauge was late just then
                if not tries_left:
                    raise
