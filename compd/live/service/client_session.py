"""One client's connection: splits what it sends into lines, and sends it what it asked for, without ever waiting."""

from __future__ import annotations

import errno
import math
import os
import socket
import struct
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from enum import Enum, auto
from typing import Any, NamedTuple

from compd.live.service.descriptor_bin import DescriptorBin
from compd.live.service.messages import MAX_LINE_BYTES, ErrorCode, ProtocolError

# About 150 setpoints: 0.7 s at 200 Hz. A client that is further behind acts on old setpoints.
MAX_BEHIND_BYTES = 128 * 1024
# About 1500 READINGS: 1.5 s at 1 kHz. A recorder needs all of them, however late, and runs on this computer.
MAX_READINGS_BEHIND_BYTES = 8 * 1024 * 1024
_RECEIVE_BYTES = 4096
_LAST_RECEIVE_BYTES = 64 * 1024
_MAX_INTERVAL_S = 1e6
# struct ucred of unix(7): process, user, group.
_CREDENTIALS = struct.Struct("3i")
# Of SCM_RIGHTS, and how many may come at once: SCM_MAX_FD of unix(7).
_DESCRIPTOR = struct.Struct("i")
_MAX_DESCRIPTORS = 253


class Stream(Enum):
    """What a client may watch."""

    SETPOINTS = auto()
    READINGS = auto()


class Place(Enum):
    """What a line that comes does with those that still wait."""

    OWN = auto()
    NEWEST = auto()
    """it takes the place of an earlier one of this kind"""
    FIXED = auto()
    """what came before it is answered before it"""


class _ReceivedLine(NamedTuple):
    """A line, or the error in the place of one that is too long; the descriptor that came with it, and when it came.

    place : whether a newer one of its kind takes its place.
    """

    content: bytes | ProtocolError
    descriptor: int | None
    arrived_s: float
    place: Place = Place.OWN


def _own_place(line: bytes) -> Place:
    return Place.OWN


class ClientSession:
    """A connected client; used by the publisher's thread alone.

    Over the Unix socket a line may come with one open descriptor (SCM_RIGHTS), sent in the same `sendmsg`. It belongs
    to that line and is closed after it: a request that wants it takes it. At most two wait at any time.

    Attributes
    ----------
    name : for the log: "unix, user 1000", or the address and port.
    open : False once the connection has ended, and what came over it has been answered.
    has_ended : whether the other end sends nothing any more.
    arrived_s : monotonic time (s) at which the line that is being answered came.
    due_s : time of the next setpoint (s) that this client wants; inf while it watches none, -inf for the very next.
    stream : what this client watches.
    user : number of the user at the other end of the Unix socket; -1 over TCP.
    authorized : whether it may ask anything but AUTH.
    lost_role : whether its role as the controller was taken from it.
    connected_s, asked_s : monotonic time (s) of its connection, and of its last request.
    dismissed_s : from when on its connection is to be closed; inf for never.
    """

    def __init__(
        self,
        connection: socket.socket,
        name: str,
        local: bool,
        unwanted: DescriptorBin,
        now_s: float = 0.0,
        place_of: Callable[[bytes], Place] = _own_place,
    ) -> None:
        """`name`: of the other end; `local`: connected over the Unix socket, from this computer; `unwanted`: closes
        descriptors; `place_of`: of a line among those that wait."""
        connection.setblocking(False)
        self.connection = connection
        self.local = local
        self.user = _user(connection) if local else -1
        self.name = f"{name}, user {self.user}" if local else name
        self.authorized = True
        self.lost_role = False
        self.connected_s = self.asked_s = self.arrived_s = now_s
        self.dismissed_s = math.inf
        self.open = True
        self.has_ended = False
        self.due_s = math.inf
        self.stream = Stream.SETPOINTS
        self._interval_s = math.inf
        self._max_behind_bytes = MAX_BEHIND_BYTES
        self._received = bytearray()
        self._lines: deque[_ReceivedLine] = deque()
        self._unwanted = unwanted
        self._descriptor: int | None = None  # of the line that is still coming
        self._answered_descriptor: int | None = None  # of the line that `next_line` has given
        self._skipping_line = False
        self._place_of = place_of
        self._unsent = bytearray()

    def watch(self, rate_hz: float, stream: Stream) -> None:
        """Send `rate_hz` messages of the stream per second from now on: inf for every one, 0 for none."""
        self.stream = stream
        self._max_behind_bytes = MAX_READINGS_BEHIND_BYTES if stream is Stream.READINGS else MAX_BEHIND_BYTES
        self._interval_s = min(1.0 / rate_hz, _MAX_INTERVAL_S) if rate_hz else math.inf
        self.due_s = -math.inf if rate_hz else math.inf

    @property
    def watches_readings(self) -> bool:
        """Whether it is sent the readings, and the orders among them."""
        return self.stream is Stream.READINGS and self.due_s < math.inf

    def take(self, time_s: float, half_period_s: float) -> bool:
        """Whether the setpoint of `time_s` is the one that is due; the next is then due an interval later.

        Half a period of tolerance keeps a rate that divides the loop's even, whatever the jitter of its times.
        """
        if time_s < self.due_s - half_period_s:
            return False
        self.due_s += self._interval_s
        if self.due_s < time_s:  # the first setpoint, or an interval was missed: count from this one
            self.due_s = time_s + self._interval_s
        return True

    def receive(self, now_s: float) -> None:
        """Take what has arrived; whole lines wait for `next_line`.

        Where the stream has ended `has_ended` is True afterwards: lines that wait can still be answered, but what is
        for a moment only has passed. `open` is False where the connection is broken.
        """
        try:
            data, descriptor = self._receive_bytes()
        except BlockingIOError:
            return
        except OSError:
            data, descriptor = b"", None
            self.open = False
        if not data:
            self.has_ended = True
            self._remove_older()
            return
        self._received += data
        *lines, rest = self._received.split(b"\n")
        self._received = rest
        # of each whole line, and of the one that is still coming
        owned: list[int | None] = [self._descriptor, *[None] * len(lines)]
        if descriptor is not None:
            # what the system gives at once ends with the bytes that came with a descriptor: it is the last line's
            last = len(lines) if rest else len(lines) - 1
            if owned[last] is None:
                owned[last] = descriptor
            else:
                self._unwanted.put(descriptor)
        self._descriptor = owned.pop()
        for line, of_line in zip(lines, owned, strict=True):
            self._add_line(bytes(line), of_line, now_s)
        if len(rest) > MAX_LINE_BYTES:
            self._received = bytearray()
            self._unwant(self._descriptor)
            self._descriptor = None
            if not self._skipping_line:
                self._skipping_line = True
                self._lines.append(_ReceivedLine(_too_long(), None, now_s))

    def _receive_bytes(self) -> tuple[bytes, int | None]:
        """What has arrived, and the first descriptor among it; TCP carries none.

        Every one is taken: what is left the system closes, in this thread, which may wait for it. Raises
        BlockingIOError where one comes before those that came have been closed, and OSError where these hang.
        """
        if not self.local:
            return self.connection.recv(_RECEIVE_BYTES), None
        if self._unwanted.is_full:
            _, _, flags, _ = self.connection.recvmsg(_RECEIVE_BYTES, 0, socket.MSG_PEEK)
            if flags & socket.MSG_CTRUNC:
                raise (OSError if self._unwanted.hangs else BlockingIOError)(errno.EMFILE, os.strerror(errno.EMFILE))
        # socket.recv_fds of Python 3.11 leaves the flags out
        data, control, _, _ = self.connection.recvmsg(
            _RECEIVE_BYTES, socket.CMSG_LEN(_MAX_DESCRIPTORS * _DESCRIPTOR.size), socket.MSG_CMSG_CLOEXEC
        )
        received = [
            descriptor
            for level, kind, content in control
            if (level, kind) == (socket.SOL_SOCKET, socket.SCM_RIGHTS)
            for (descriptor,) in _DESCRIPTOR.iter_unpack(content[: len(content) // _DESCRIPTOR.size * _DESCRIPTOR.size])
        ]
        for descriptor in received[1:]:
            self._unwanted.put(descriptor)
        return data, received[0] if received else None

    def _add_line(self, line: bytes, descriptor: int | None, now_s: float) -> None:
        if self._skipping_line:
            self._skipping_line = False
        elif len(line) > MAX_LINE_BYTES:
            self._lines.append(_ReceivedLine(_too_long(), None, now_s))
        elif line.strip():
            place = self._place_of(line)
            if place is Place.NEWEST:
                self._remove_older()
            self._lines.append(_ReceivedLine(line, descriptor, now_s, place))
            return
        self._unwant(descriptor)

    def _remove_older(self) -> None:
        """Forget the line that one of the kind NEWEST replaces, unless another had to be answered in between."""
        for k in reversed(range(len(self._lines))):
            if self._lines[k].place is Place.FIXED:
                return
            if self._lines[k].place is Place.NEWEST:
                self._unwant(self._lines[k].descriptor)
                del self._lines[k]
                return

    def _unwant(self, descriptor: int | None) -> None:
        if descriptor is not None:
            self._unwanted.put(descriptor)

    @property
    def is_served(self) -> bool:
        """Whether its requests are answered: it has not been dismissed."""
        return self.dismissed_s == math.inf

    @property
    def has_lines(self) -> bool:
        """Whether whole lines wait."""
        return bool(self._lines)

    @property
    def is_read(self) -> bool:
        """Whether more should be received: not as long as a line waits that a newer one does not replace."""
        newest_only = all(line.place is Place.NEWEST for line in self._lines)
        return self.is_served and not self.has_ended and newest_only

    def next_line(self) -> bytes | ProtocolError:
        """The line that has waited longest, or an error in the place of one that is too long.

        The descriptor that came with it can be taken until `end_line`, or the next one, closes it.
        """
        self.end_line()
        content, self._answered_descriptor, self.arrived_s, _ = self._lines.popleft()
        return content

    def take_descriptor(self) -> int | None:
        """The descriptor that came with the line; whoever takes it closes it. None where none came, or it is taken."""
        descriptor, self._answered_descriptor = self._answered_descriptor, None
        return descriptor

    def end_line(self) -> None:
        """The line has been answered: what came with it and was not taken is closed."""
        self._unwant(self.take_descriptor())

    def send(self, data: bytes) -> bool:
        """Send what the system takes at once and keep the rest; False when the client is too far behind."""
        if len(self._unsent) + len(data) > self._max_behind_bytes:
            return False
        self._unsent += data
        self.flush()
        return True

    def flush(self) -> None:
        """Send what is unsent, as far as the system takes it."""
        try:
            while self._unsent:
                del self._unsent[: self.connection.send(self._unsent)]
        except BlockingIOError:
            return
        except OSError:
            self.open = False

    @property
    def has_unsent(self) -> bool:
        """Whether bytes wait until the system takes them."""
        return bool(self._unsent)

    def summary(self, controller: bool) -> dict[str, Any]:
        """Who it is, for STATUS; `controller`: whether its target counts."""
        summary: dict[str, Any] = {
            "name": self.name,
            "connected_s": round(self.connected_s, 3),
            "controller": controller,
        }
        if self.local:
            summary["user"] = self.user
        if self.due_s < math.inf:
            summary["watches"] = self.stream.name.lower()
        return summary

    def close(self) -> None:
        """Close the connection, and the descriptors that came over it."""
        self.open = False
        self.end_line()
        for line in self._lines:
            self._unwant(line.descriptor)
        self._lines.clear()
        self._unwant(self._descriptor)
        self._descriptor = None
        if self.local:  # with descriptors among what nobody has read, it may wait
            self._unwanted.put(self.connection.detach())
            return
        with suppress(OSError):  # with data that nobody has read the system would reset it, and the last line be lost
            self.connection.recv(_LAST_RECEIVE_BYTES)
        self.connection.close()


def _user(connection: socket.socket) -> int:
    """Number of the user at the other end of a Unix socket."""
    _, user, _ = _CREDENTIALS.unpack(connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))
    return int(user)


def _too_long() -> ProtocolError:
    return ProtocolError(ErrorCode.LINE_TOO_LONG, f"a line has at most {MAX_LINE_BYTES} bytes")
