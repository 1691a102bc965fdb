"""The real thing: a pty or a TCP port of this computer, with the device and its faults behind it."""

from __future__ import annotations

import heapq
import itertools
import os
import select
import threading
from pathlib import Path

from compd.clock import MonotonicClock
from compd.commissioning.conformance.peer import Peer
from compd.lines import Line, open_line
from compd.lines.line_settings import PolledLineSettings
from compd.lines.port_arguments import PortArguments
from compd.lines.registry import polled_kind
from compd.twins.wire_ends import End

FAST_BAUD = 115200
CHARACTER_BITS = 10  # 8N1: a pty knows no parity
TURNAROUND_S = 1e-3
# Long enough that a busy computer's pauses do not pass for a silent device.
TIMEOUT_S = 0.2
FORMAT = "8N1"


class RealWire:
    """`open` gives the product's own line to it. One thread serves it, from its creation to `close`."""

    exact = False
    pause_s = 0.0

    def __init__(
        self, peer: Peer, kind: str, directory: Path, baud: int = FAST_BAUD, timeout_s: float = TIMEOUT_S
    ) -> None:
        """`directory`: where a pty appears, as `port`."""
        self._kind = polled_kind(kind)
        self.peer = peer
        self.clock = MonotonicClock()
        self.timeout_s = timeout_s
        self.character_s = 0.0 if self._kind.over_network else CHARACTER_BITS / baud
        self._baud = baud
        self._link = directory / "port"
        self._port = ""  # for the line, once it is open
        self._number = 0  # of a network port
        self._end: End | None = None
        self._arriving: list[tuple[float, int, int, bytes]] = []  # due (s), order, to whom, what
        self._order = itertools.count()
        self._wake_read, self._wake_write = os.pipe()
        self._plugged = True
        self._stopping = False
        self._followed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wire under test", daemon=True)
        self._thread.start()
        self._follow()

    def open(self) -> Line:
        """Raises LineFault(LINE_LOST) while the plug is out."""
        return open_line(self._settings(), self.clock)

    def unplug(self) -> None:
        self._plugged = False
        self._follow()

    def replug(self) -> None:
        self._plugged = True
        self._follow()

    def close(self) -> None:
        """End the thread and give everything back."""
        self._stopping = True
        os.write(self._wake_write, b"!")
        self._thread.join()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def _settings(self) -> PolledLineSettings:
        port = PortArguments(self._port, self._baud, FORMAT, self.timeout_s)
        settings = self._kind.settings.model_validate(
            {"kind": self._kind.kind, **self._kind.port_keys(port), "timeout_s": self.timeout_s}
        )
        assert isinstance(settings, PolledLineSettings)
        return settings

    def _follow(self) -> None:
        """Let the thread see what was set, and wait until it has."""
        self._followed.clear()
        os.write(self._wake_write, b"!")
        self._followed.wait()

    def _run(self) -> None:
        while not self._stopping:
            fds = self._end.fds() if self._end is not None else []
            ready, _, _ = select.select([self._wake_read, *fds], [], [], self._deliver())
            for fd in ready:
                if fd != self._wake_read and self._end is not None:
                    self._hear(self._end, fd)
            if self._wake_read in ready:
                os.read(self._wake_read, 1)
                self._set_plug(self._plugged)
                self._followed.set()
        self._set_plug(False)

    def _set_plug(self, plugged: bool) -> None:
        if plugged and self._end is None:
            self._end = end = self._kind.twin.end(None, self._link, self._number)
            self._number = end.number
            self._port = end.port if isinstance(end.port, str) else "{}:{}".format(*end.port)
        elif not plugged and self._end is not None:
            self._end.close()
            self._end = None
            self._arriving.clear()

    def _hear(self, end: End, fd: int) -> None:
        data = end.read(fd)
        if not data:  # a client that comes or goes: nothing is under way to it
            self._arriving = [item for item in self._arriving if item[2] != fd]
            heapq.heapify(self._arriving)
            return
        # A pty passes a request on at once; on a wire it takes its time.
        heard_s = self.clock.monotonic() + len(data) * self.character_s
        for piece in self.peer.answer(data, heard_s, self.timeout_s):
            due_s = heard_s + TURNAROUND_S + piece.delay_s
            for byte in piece.data if self._baud < FAST_BAUD else ():
                due_s += self.character_s
                heapq.heappush(self._arriving, (due_s, next(self._order), fd, bytes([byte])))
            if self._baud >= FAST_BAUD and piece.data:
                due_s += len(piece.data) * self.character_s
                heapq.heappush(self._arriving, (due_s, next(self._order), fd, piece.data))

    def _deliver(self) -> float | None:
        """Write what is due; the time (s) until more is, None if nothing is under way."""
        while self._arriving and self._end is not None:
            due_s, _, fd, data = self._arriving[0]
            wait_s = due_s - self.clock.monotonic()
            if wait_s > 0:
                return wait_s
            heapq.heappop(self._arriving)
            self._end.write(fd, data)
        return None
