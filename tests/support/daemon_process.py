"""`compd run` and its processes as a system sees them."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

import yaml

from compd.client import Client, connect
from compd.demo.processes import START_TIMEOUT_S, STOP_TIMEOUT_S
from tests.support.misbehaving import DIAL_CHANNEL
from tests.support.patience import PATIENCE_S
from tests.support.watching import Message, Rules, Watcher


class Pidfds:
    """Handles of processes, taken while they run, so that no other process can be meant later."""

    def __init__(self, pids: Iterable[int]) -> None:
        self._descriptors = {os.pidfd_open(pid): pid for pid in pids}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for descriptor in self._descriptors:
            os.close(descriptor)

    def wait_for_ends(self, patience_s: float = PATIENCE_S) -> None:
        """Return when every process has ended; fails with those that have not."""
        left = dict(self._descriptors)
        poller, end_s = select.poll(), time.monotonic() + patience_s
        for descriptor in left:
            poller.register(descriptor, select.POLLIN)
        while left:
            ready = poller.poll(max(0.0, end_s - time.monotonic()) * 1e3)
            assert ready, f"processes that do not end: {sorted(left.values())}"
            for descriptor, _ in ready:
                poller.unregister(descriptor)
                del left[descriptor]


class Daemon:
    """`compd run` as a process group. A context manager: runs in the block, and leaves nothing behind.

    The group is in the test's own session: in an orphaned one SIGTSTP would have no effect.
    """

    def __init__(self, config: Path) -> None:
        self.config = config
        self.log = config.with_suffix(".log")
        data = yaml.safe_load(config.read_text())
        self.socket = Path(data["sockets"]["unix"]["path"])
        self.rate_hz = float(data["loop"]["rate_hz"])
        loop = data["loop"]
        self.rules = Rules(1 / self.rate_hz, data["limits"]["slew_mm_per_s"], loop["stale_after_s"], loop["hold_s"])
        self.process: subprocess.Popen[bytes]

    def __enter__(self) -> Self:
        notify = self.config.with_suffix(".notify")
        notify.unlink(missing_ok=True)
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager, self.log.open("wb") as log:
            manager.bind(str(notify))
            self.process = subprocess.Popen(
                [sys.executable, "-m", "compd", "run", str(self.config)],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                process_group=0,
                env={**os.environ, "NOTIFY_SOCKET": str(notify), "PYTHONUNBUFFERED": "1"},
            )
            try:
                self._wait_for_ready(manager)
            except BaseException:  # Ctrl-C, too, leaves no daemon running
                self.stop()
                raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """End it in whatever state it is; whatever is left of it is killed."""
        if self.process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGCONT)
            self.process.terminate()
            try:
                self.process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        for pid in self.left():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def ends(self) -> bool:
        """Wait for the main process to end by itself; whether it did."""
        try:
            self.process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return False
        return True

    @property
    def alive(self) -> bool:
        """Whether the main process runs."""
        return self.process.poll() is None

    def status(self) -> Message:
        """STATUS, over a connection of its own."""
        with self.connected() as client:
            return client.status()

    def connected(self) -> Client:
        return connect(self.socket, PATIENCE_S)

    def processes(self) -> dict[str, Message]:
        """The daemon's processes by name, as STATUS has them."""
        processes: dict[str, Message] = self.status()["processes"]
        return processes

    def pids(self) -> dict[str, int]:
        return {name: int(process["pid"]) for name, process in self.processes().items()}

    def quality(self, channel: str = DIAL_CHANNEL) -> str:
        """What STATUS says of a channel."""
        return next(str(gauge["quality"]) for gauge in self.status()["gauges"] if gauge["channel"] == channel)

    def left(self) -> list[int]:
        """Every process of this daemon that the system has; they have the configuration in their command lines."""
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdecimal():
                with contextlib.suppress(OSError):
                    if str(self.config).encode() in (entry / "cmdline").read_bytes().split(b"\0"):
                        found.append(int(entry.name))
        return found

    @contextmanager
    def watched(self, rate_hz: float | None = None) -> Iterator[Watcher]:
        """A client that watches during the block; no setpoint may break a rule.

        rate_hz : None for every setpoint, which at 1 kHz is more than a busy computer can read.
        """
        watcher = Watcher(self.socket, self.rules, rate_hz)
        try:
            yield watcher
        finally:
            watcher.close()
        assert not watcher.broken, f"{len(watcher.broken)} broken rules, the first: {watcher.broken[0]}"

    def _wait_for_ready(self, manager: socket.socket) -> None:
        end = os.pidfd_open(self.process.pid)
        try:
            poller = select.poll()
            poller.register(manager, select.POLLIN)
            poller.register(end, select.POLLIN)
            limit_s = time.monotonic() + START_TIMEOUT_S
            while True:
                ready = [descriptor for descriptor, _ in poller.poll(max(0.0, limit_s - time.monotonic()) * 1e3)]
                assert ready, f"not ready in {START_TIMEOUT_S} s:\n{self._tail()}"
                assert end not in ready, f"ended with {self.process.wait()}:\n{self._tail()}"
                if manager.recv(4096) == b"READY=1":
                    return
        finally:
            os.close(end)

    def _tail(self) -> str:
        return self.log.read_text(errors="replace")[-8000:]
