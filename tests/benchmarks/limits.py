"""Limits on a benchmark's time, and on its wait for the first good setpoint: every benchmark ends by itself."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from compd.client import Message, connect

# Of a whole benchmark, in full size.
ENDS_WITHIN_S = 3600.0
BEGINS_WITHIN_S = 30.0
SMALLEST = "--smallest"


def run_limited(main: Callable[[], None], **smallest: object) -> None:
    """Run a benchmark's `main`; with `--smallest` its module has these sizes in place of its own."""
    if SMALLEST in sys.argv:
        sys.argv.remove(SMALLEST)
        main.__globals__.update(smallest)
    name = Path(sys.argv[0]).stem
    sentence = f"{name} has not ended after {ENDS_WITHIN_S:g} s. Run it again on an idle computer"
    with limit(ENDS_WITHIN_S, lambda: sentence):
        main()


@contextmanager
def limit(seconds: float, why: Callable[[], str]) -> Iterator[None]:
    """End the program with the sentence `why` when the block takes longer; the limit of a block around it remains."""

    def end(*_: object) -> None:
        raise SystemExit(why())

    began_s = time.monotonic()
    handler = signal.signal(signal.SIGALRM, end)
    around_s, _ = signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, handler)
        if around_s:
            signal.setitimer(signal.ITIMER_REAL, max(around_s - (time.monotonic() - began_s), 1e-3))


def first_good(socket: Path | str, within_s: float = BEGINS_WITHIN_S) -> Message:
    """The daemon's first setpoint with state ok. SystemExit says why there is none."""
    last: dict[str, Any] = {}

    def why() -> str:
        seen = f"the daemon's state is {last['state']}: {last['reason']}" if last else "the daemon sent no setpoint"
        return f"The benchmark cannot begin. After {within_s:g} s {seen}"

    with limit(within_s, why), connect(socket) as client:
        for setpoint in client.watch():
            last.update(setpoint)
            if setpoint["state"] == "ok":
                return setpoint
    raise SystemExit("The benchmark cannot begin. The daemon closed the connection before its first good setpoint")


def printed_lines(client: subprocess.Popen[str], count: int) -> list[str]:
    """The first `count` lines that a client prints. SystemExit where it ends before: the daemon drops a slow client."""
    assert client.stdout is not None
    lines = [line for line in (client.stdout.readline() for _ in range(count)) if line]
    if len(lines) < count:
        raise SystemExit(f"The client ended after {len(lines)} of {count} setpoints. Run again on an idle computer")
    return lines
