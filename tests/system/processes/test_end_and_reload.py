"""The end, and a new configuration."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

import yaml

from compd.client import Client, connect
from compd.errors import DaemonError
from compd.setpoint_states import State
from tests.support.daemon_process import Daemon, Pidfds
from tests.support.patience import PATIENCE_S
from tests.support.process_checks import is_ok
from tests.support.processes import RATE_HZ
from tests.support.watching import Seen, until


def check_goodbye(seen: list[Seen], reason: str) -> None:
    """The last setpoints of a stream: held for this reason, and a stop in the end.

    A computer that pauses in between makes the loop miss its time, which is a stop of its own; a gauge that answers
    late at that moment is a reason of its own, which stands before this one.
    """
    announced = next((i for i, s in enumerate(seen) if reason in s["reason"]), None)
    assert announced is not None, f"no reason contains {reason!r}: {seen[-1].setpoint}"
    assert seen[announced]["state"] != State.STOP, "it is held before it stops"
    for s in seen[announced:]:
        own, _, _ = s["reason"].partition(reason)
        if s["state"] == State.REFUSED:
            assert "(`limits." in own, f"refused without a reason of its own: {s.setpoint}"
        else:
            assert s["state"] in (State.HOLD, State.STOP)
    states = [s["state"] for s in seen[announced:]]
    assert states[-1] == State.STOP, "the last setpoint is invalid"


def test_sigterm_is_told_to_clients_and_leaves_nothing(fresh: Daemon) -> None:
    pids = fresh.pids()
    with fresh.watched() as watcher, Pidfds(pids.values()) as processes:
        watcher.for_s(0.2)
        since = watcher.now
        start_s = time.monotonic()
        fresh.process.terminate()
        assert fresh.process.wait(PATIENCE_S) == 0, fresh.log.read_text()[-4000:]
        print(f"ended {time.monotonic() - start_s:.2f} s after SIGTERM")
        processes.wait_for_ends()
        watcher.until_end()
        check_goodbye(watcher.seen[since:], "stopping")
    assert not fresh.socket.exists()
    assert not fresh.left()


def changed(config: Path, **loop: Any) -> None:
    """Write these keys of `loop:` into a configuration."""
    data = yaml.safe_load(config.read_text())
    data["loop"] |= loop
    new = config.with_suffix(".new")
    new.write_text(yaml.safe_dump(data, sort_keys=False))
    new.rename(config)


def test_sighup_with_an_invalid_configuration_changes_nothing(changing: Daemon) -> None:
    pids = changing.pids()
    with changing.connected() as client:
        config_hash = client.version["config_hash"]
    with changing.watched() as watcher:
        since = watcher.now
        changed(changing.config, rate_hz=-1)
        os.kill(changing.process.pid, signal.SIGHUP)
        until("the log says why", lambda: "loop.rate_hz" in changing.log.read_text(errors="replace"))
        watcher.for_s(1.0)
        assert not watcher.ended
        assert not [seen.setpoint for seen in watcher.seen[since:] if "configuration" in seen["reason"]]
    assert changing.pids() == pids
    with changing.connected() as client:
        assert client.version["config_hash"] == config_hash


def test_sighup_brings_a_changed_configuration_under_the_same_main_process(changing: Daemon) -> None:
    with changing.connected() as client:
        config_hash = client.version["config_hash"]
    with changing.watched() as watcher:
        watcher.for_s(0.2)
        since = watcher.now
        changed(changing.config, rate_hz=RATE_HZ / 2)
        start_s = time.monotonic()
        os.kill(changing.process.pid, signal.SIGHUP)
        watcher.until_end()
        check_goodbye(watcher.seen[since:], "configuration")

    def comes_back() -> Client | None:
        assert changing.alive
        try:
            return connect(changing.socket, PATIENCE_S)
        except DaemonError:
            return None

    with until("it listens again", comes_back) as client:
        assert client.version["config_hash"] != config_hash
        status = client.status()
        assert status["config_hash"] == client.version["config_hash"]
        assert status["loop"]["rate_hz"] == RATE_HZ / 2
        assert status["processes"]["supervisor"]["pid"] == changing.process.pid
        assert status["zero"]["taken"], "a rate changes no machine zero"
    with changing.watched() as watcher:
        watcher.until("ok", is_ok)
        print(f"ok {time.monotonic() - start_s:.2f} s after SIGHUP")
