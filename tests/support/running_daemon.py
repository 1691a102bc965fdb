"""A whole daemon, supervised in a process of its own, with all its processes below it."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from compd.configuration import Configuration
from compd.live.daemon import Daemon
from compd.live.supervisor import Supervisor
from compd.live.system import THIS_COMPUTER, ChildProcess, Notifier
from tests.support.patience import PATIENCE_S


@contextmanager
def supervised(configuration: Configuration, notifier: Notifier | None = None) -> Iterator[Daemon]:
    """Its processes run, and its gauges are polled, until the block ends.

    What the daemon shares with them can be read and written here.
    """
    clock = THIS_COMPUTER
    daemon = Daemon(configuration)
    notifier = notifier or Notifier("")
    supervisor = Supervisor(daemon, notifier, clock)
    process = ChildProcess("supervisor", lambda: supervisor.run(lambda: None, lambda: False), clock)
    process.start()
    try:
        polling = clock.monotonic() + PATIENCE_S
        while not all(acquisition.beats for acquisition in daemon.acquisition):
            assert clock.monotonic() < polling, "the gauges are not polled"
            clock.wait(threading.Event(), 0.005)
        yield daemon
    finally:
        os.kill(process.pid, signal.SIGTERM)
        process.wait()
        daemon.close()
        notifier.close()
