"""The simulated machine, the daemon and the page, until Ctrl-C: `make live`."""

from __future__ import annotations

from collections.abc import Callable

from compd.configuration import Configuration
from compd.demo.machine_zero import take_zero
from compd.demo.processes import simulated_daemon

# Speed-up of weather and warm-up: an hour in three minutes makes the motion visible.
LIVE_SPEEDUP = 20.0
# Time (s) at machine zero, in which zero is taken.
ZERO_HOLD_S = 30.0


def run_live(configuration: Configuration, seed: int, serve: Callable[[str], None]) -> None:
    """Start the simulated machine and its daemon, take machine zero, and `serve`; stop both when that returns.

    serve : called with the daemon's Unix socket; returns when a person has had enough.
    Raises DaemonError if one does not start.
    """
    with simulated_daemon(configuration, seed, LIVE_SPEEDUP, ZERO_HOLD_S) as directory:
        take_zero(directory / "compd.sock")
        serve(str(directory / "compd.sock"))
