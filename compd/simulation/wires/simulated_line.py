"""A simulated line: its devices on a real pty or network port, at the line's baud rate, and its faults.

A serial line is a pty whose replies come at the baud rate; a TCP line is a listening socket on this computer: the twin
of the line's kind. The daemon opens either as it would the real one.
"""

from __future__ import annotations

import os
import select
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from compd.clock import MonotonicClock
from compd.line_settings import PolledLineSettings
from compd.lines import polled_definition
from compd.twins import LATE, UNPLUGGED, End, Port, SimulatedByteDevice, SimulatedRegisterDevice, checked_fault

# Replies are written in pieces of this duration; shorter pieces would only cost processor time.
PIECE_S = 1e-3
# Delay of a reply with the fault "late", in line timeouts.
LATE_TIMEOUTS = 1.5


@dataclass
class _Reply:
    """A reply under way: transmission starts at start_s to fd; `sent` bytes of it are written."""

    start_s: float
    fd: int
    data: bytes
    sent: int = 0


class SimulatedLine:
    """One configured line with its devices, served by a thread of its own."""

    def __init__(
        self,
        name: str,
        settings: PolledLineSettings,
        devices: Sequence[SimulatedByteDevice] | Sequence[SimulatedRegisterDevice],
        directory: Path,
    ) -> None:
        """directory : where a serial line's port appears, as `name`."""
        self.replies = 0  # number of replies, including those that a fault suppresses
        self._settings = settings
        self._clock = MonotonicClock()
        self._link = directory / name
        self._twin = polled_definition(settings).twin
        self._listener = self._twin.listener(settings, devices)
        self._character_s = self._twin.character_s(settings)
        self._number = 0  # of the network port, once it is open
        self._end: End | None = None
        self._replies: list[_Reply] = []
        self._fault: str | None = None
        self._requested_fault: str | None = None  # applied by the line's thread between two replies
        self._wake_read, self._wake_write = os.pipe()
        self._stopping = False
        self._applied = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"simulated {name}", daemon=True)

    def start(self) -> Port:
        """Open the port and serve it. Returns the port for the daemon: device path, pyserial URL, or (host, port)."""
        port = self._plug_in().port
        self._thread.start()
        return port

    def stop(self) -> None:
        """Close the port and end the thread."""
        self._stopping = True
        self._wake()
        self._thread.join()
        os.close(self._wake_read)
        os.close(self._wake_write)

    @property
    def faults(self) -> tuple[str, ...]:
        """Faults that this kind of line can have."""
        return (*self._twin.damages, UNPLUGGED)

    @property
    def fault(self) -> str | None:
        """The line's fault, or None. Setting it returns when the fault is applied."""
        return self._fault

    @fault.setter
    def fault(self, fault: str | None) -> None:
        wanted = checked_fault(fault, self.faults, self._settings.kind)
        if not self._thread.is_alive():
            raise RuntimeError("only a line that is served can have a fault: start it first")
        self._requested_fault = wanted
        self._applied.clear()
        self._wake()
        self._applied.wait()

    @property
    def replies_under_way(self) -> int:
        """Number of replies that are not written whole yet."""
        return len(self._replies)

    def _wake(self) -> None:
        os.write(self._wake_write, b"!")

    def _plug_in(self) -> End:
        self._end = end = self._twin.end(self._settings, self._link, self._number)
        self._number = end.number
        return end

    def _pull_out(self) -> None:
        if self._end is not None:
            self._end.close()
        self._end = None
        self._replies.clear()

    def _run(self) -> None:
        while not self._stopping:
            fds = self._end.fds() if self._end is not None else []
            ready, _, _ = select.select([self._wake_read, *fds], [], [], self._transmit())
            for fd in ready:
                if fd == self._wake_read:
                    os.read(fd, 4096)
                    self._apply_fault()
                elif self._end is not None:
                    self._receive(self._end, fd)
        self._pull_out()

    def _apply_fault(self) -> None:
        self._fault = self._requested_fault
        if self._fault == UNPLUGGED:
            self._pull_out()
        elif self._end is None:
            self._plug_in()
        self._applied.set()

    def _receive(self, end: End, fd: int) -> None:
        data = end.read(fd)
        reply = self._listener.receive(data)
        if not reply:
            return
        self.replies += 1
        # transmission of the request takes time, too
        start_s = self._clock.monotonic() + len(data) * self._character_s
        if self._fault is not None:
            reply = self._twin.damages[self._fault](reply)
        if self._fault == LATE:
            start_s += LATE_TIMEOUTS * self._settings.timeout_s
        if self._replies:  # in order, even behind a late one
            start_s = max(start_s, self._end_s(self._replies[-1]))
        self._replies.append(_Reply(start_s, fd, reply))

    def _transmit(self) -> float | None:
        """Write what is due; returns the time in s until more is due, None if no reply is under way."""
        if self._end is None:
            return None
        now_s = self._clock.monotonic()
        while self._replies:
            reply = self._replies[0]
            if now_s >= self._end_s(reply):
                self._end.write(reply.fd, reply.data[reply.sent :])
                del self._replies[0]
                continue
            if now_s < reply.start_s:
                return min(reply.start_s + PIECE_S, self._end_s(reply)) - now_s
            due = int((now_s - reply.start_s) / self._character_s)
            self._end.write(reply.fd, reply.data[reply.sent : due])
            reply.sent = due
            return min(PIECE_S, self._end_s(reply) - now_s)
        return None

    def _end_s(self, reply: _Reply) -> float:
        return reply.start_s + len(reply.data) * self._character_s
