"""Machine zero of a simulated machine: taken as soon as every gauge is read."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from compd.client import Client, connect
from compd.errors import DaemonError
from compd.gauge import Quality

# Timeout (s) of taking machine zero, which averages the gauges for a second.
ANSWER_TIMEOUT_S = 15.0
WATCH_HZ = 10.0
ZERO_TRIES = 3
# Longest wait (s) for the first reading of every gauge.
GAUGES_TIMEOUT_S = 60.0
# A simulated gauge is never broken.
TOO_SLOW = "end other programs: this computer is too slow, or too busy, to answer for every gauge in time"


def take_zero(unix_socket: Path) -> None:
    """Take machine zero of a daemon as soon as every gauge is good. Raises DaemonError after ZERO_TRIES refusals."""
    with connect(unix_socket, ANSWER_TIMEOUT_S) as observer, connect(unix_socket, ANSWER_TIMEOUT_S) as daemon:
        setpoints = daemon.watch(WATCH_HZ)
        for tries_left in reversed(range(ZERO_TRIES)):
            wait_for_gauges(observer, setpoints, (Quality.OK, Quality.DISTRUSTED))
            try:
                observer.zero(replace=True)  # a gauge that was late may be distrusted, and is as good as the others
                return
            except DaemonError as error:  # a gauge was late just then
                if not tries_left:
                    raise _refused(error) from error


def wait_for_gauges(
    observer: Client, setpoints: Iterator[dict[str, Any]], settled: Sequence[str] = (Quality.OK,)
) -> None:
    """Return once every gauge has one of these qualities; asks once per setpoint.

    Raises DaemonError after GAUGES_TIMEOUT_S.
    """
    end_s = time.monotonic() + GAUGES_TIMEOUT_S
    not_good: list[str] = []
    for _ in setpoints:
        gauges = observer.status()["gauges"]
        not_good = [f"{gauge['channel']} {gauge['quality']}" for gauge in gauges if gauge["quality"] not in settled]
        if not not_good:
            return
        if time.monotonic() > end_s:
            break
    raise DaemonError.of(
        "gauges", f"not all are read within {GAUGES_TIMEOUT_S:g} s", value=", ".join(not_good), next_step=TOO_SLOW
    )


def _refused(error: DaemonError) -> DaemonError:
    """The error in place of the daemon's, which tells the owner of a real machine to mend a gauge."""
    reason = error.problems[0].what.partition("\n")[0]
    return DaemonError.of("machine zero", f"the daemon refused it {ZERO_TRIES} times", value=reason, next_step=TOO_SLOW)
