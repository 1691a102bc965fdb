"""Setpoints of compd for a controller: read without waiting, and judged before anything of them is used.

The standard library alone, so that it runs under the Python to which the controller belongs.
"""

from __future__ import annotations

import errno
import json
import math
import select
import socket
import time
from collections.abc import Callable
from typing import Any, NamedTuple

# Reasons of the bridge, as its pin `reason` shows them; compd_arming.py has the others and all texts.
NOT_CONNECTED, NOT_VALID, EXPIRED, OLD_SEQ, NOT_FINITE, WRONG_LINKS, TOO_LARGE, UNREADABLE, CLOCKS = range(2, 11)

# States whose setpoints are valid. One that is not known here comes from a newer daemon, and is not used.
VALID_STATES = frozenset(("ok", "slewing", "clamped", "hold", "fade", "degraded"))

# Of a setpoint's `frame`, three numbers each.
FRAME_KEYS = ("origin_M_mm", "displacement_M_mm", "rotation_M_rad")

RECONNECT_EVERY_S = 0.5
# A daemon sends a setpoint per cycle: after this silence the connection is half open.
SILENCE_S = 2.0
# Longer than any line that compd sends.
MAX_LINE = 1 << 20
# How far time_s may be ahead of this computer's clock before the clocks are not the same.
CLOCK_TOLERANCE_S = 0.01
# Messages after which the smallest delay is forgotten: the clocks of two computers drift apart.
DELAYS = 1000


class Setpoint(NamedTuple):
    """Corrections that may be used.

    correction_mm : what is added to the command of each link, mm.
    expires_s : until when, on this computer's monotonic clock, s.
    frame : origin of the base platform in {M} (mm), its displacement (mm) and rotation vector (rad) since machine
        zero, (9); None where it was not asked for.
    """

    seq: int
    correction_mm: tuple[float, ...]
    expires_s: float
    frame: tuple[float, ...] | None = None


class Refused(NamedTuple):
    """Why a setpoint is not used: one of the reasons above."""

    reason: int


class Judge:
    """Decides which setpoints may be used. One judge per connection: sequence numbers begin anew with the daemon."""

    def __init__(self, links: int, limit_mm: float, same_clock: bool, frame: bool = False) -> None:
        """limit_mm : largest correction of a link. same_clock : whether the daemon runs on this computer, so that its
        times are those of this computer's CLOCK_MONOTONIC. frame : whether the frame's displacement is needed."""
        self._links = links
        self._limit_mm = limit_mm
        self._same_clock = same_clock
        self._frame = frame
        self._last_seq = -1
        self._delays = _SmallestDelay()

    def judge(self, message: dict[str, Any], now_s: float) -> Setpoint | Refused:
        """A SETPOINT message, as it has just arrived."""
        seq, time_s, valid_until_s = (message.get(key) for key in ("seq", "time_s", "valid_until"))
        if not _is_number(seq) or not _is_number(time_s) or not _is_number(valid_until_s):
            return Refused(UNREADABLE)
        if not math.isfinite(time_s) or not math.isfinite(valid_until_s):
            return Refused(NOT_FINITE)
        if seq <= self._last_seq:
            return Refused(OLD_SEQ)
        self._last_seq = seq
        if self._same_clock and time_s > now_s + CLOCK_TOLERANCE_S:
            return Refused(CLOCKS)
        late_s = 0.0 if self._same_clock else self._delays.beyond_smallest(now_s - time_s)
        if message.get("valid") is not True or message.get("state") not in VALID_STATES:
            return Refused(NOT_VALID)
        expires_s = valid_until_s if self._same_clock else now_s - late_s + (valid_until_s - time_s)
        if now_s >= expires_s:
            return Refused(EXPIRED)
        correction_mm = message.get("correction_mm")
        if not isinstance(correction_mm, list) or len(correction_mm) != self._links:
            return Refused(WRONG_LINKS)
        reason = _unusable(correction_mm, self._limit_mm)
        if reason:
            return Refused(reason)
        if not self._frame:
            return Setpoint(seq, tuple(correction_mm), expires_s)
        try:
            frame = [x for name in FRAME_KEYS for x in message["frame"][name]]
        except (KeyError, TypeError):
            return Refused(UNREADABLE)
        reason = UNREADABLE if len(frame) != 9 else _unusable(frame, math.inf)
        return Refused(reason) if reason else Setpoint(seq, tuple(correction_mm), expires_s, tuple(frame))


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _unusable(values: list[Any], limit: float) -> int:
    """The reason why these values cannot be used; 0 where they can."""
    if not all(_is_number(value) for value in values):
        return UNREADABLE
    if not all(math.isfinite(value) for value in values):
        return NOT_FINITE
    return TOO_LARGE if any(abs(value) > limit for value in values) else 0


class _SmallestDelay:
    """How much later than the quickest of the last messages one came, where two clocks cannot be compared.

    A message that waited, in a network or because this process was stopped, is older than its arrival.
    """

    def __init__(self) -> None:
        self._before_s = self._now_s = math.inf
        self._count = 0

    def beyond_smallest(self, delay_s: float) -> float:
        self._now_s = min(self._now_s, delay_s)
        smallest_s = min(self._before_s, self._now_s)
        self._count += 1
        if self._count == DELAYS:
            self._before_s, self._now_s, self._count = self._now_s, math.inf, 0
        return delay_s - smallest_s


class Stream:
    """The daemon's messages, without ever waiting for them. Connects again by itself."""

    def __init__(self, address: str, token: str | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        """address : path of a Unix socket, or host:port. token : that of the daemon, where its TCP socket wants one."""
        self._target: Any = address
        self._family = socket.AF_UNIX
        host, colon, port = address.rpartition(":")
        if colon and "/" not in address:
            self._target, self._family = (host, int(port)), socket.AF_INET
        self._token = token
        self._clock = clock
        self._socket: socket.socket | None = None
        self._buffer = b""
        self._retry_s = -math.inf
        self._heard_s = 0.0
        self.greeted = False

    @property
    def same_clock(self) -> bool:
        """Whether the daemon is on this computer: its Unix socket is reachable from nowhere else."""
        return self._family == socket.AF_UNIX

    def wait(self, timeout_s: float) -> None:
        """Return when something has arrived, or after `timeout_s`."""
        if self._socket is None:
            time.sleep(timeout_s)
        else:
            select.select([self._socket], [], [], timeout_s)

    def poll(self) -> list[dict[str, Any]]:
        """What has arrived, oldest first. A greeting (`greeted` becomes true) begins a new connection."""
        now_s = self._clock()
        if self._socket is None and now_s >= self._retry_s:
            self._retry_s = now_s + RECONNECT_EVERY_S
            self._connect()
        if self._socket is None:
            return []
        if not self._receive(now_s) or now_s - self._heard_s > SILENCE_S or len(self._buffer) > MAX_LINE:
            self.close()
            return []
        *lines, self._buffer = self._buffer.split(b"\n")
        messages = []
        for line in lines:
            try:
                message = json.loads(line)
            except ValueError:
                self.close()  # what answers here is not compd
                return []
            if isinstance(message, dict):
                messages.append(message)
                self._answer(message.get("class"))
        return messages

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket, self._buffer, self.greeted = None, b"", False

    def _connect(self) -> None:
        connection = socket.socket(self._family, socket.SOCK_STREAM)
        connection.setblocking(False)
        error = connection.connect_ex(self._target)
        if error not in (0, errno.EINPROGRESS):
            connection.close()
            return
        self._socket, self._buffer, self._heard_s = connection, b"", self._clock()

    def _receive(self, now_s: float) -> bool:
        """Append what has arrived; False where the connection has ended."""
        assert self._socket is not None
        while True:
            try:
                piece = self._socket.recv(1 << 16)
            except BlockingIOError:
                return True
            except OSError:
                return False
            if not piece:
                return False
            self._buffer += piece
            self._heard_s = now_s

    def _answer(self, message_class: Any) -> None:
        """What the daemon's greeting asks for."""
        if message_class == "AUTH" and self._token is not None:
            self._send({"class": "AUTH", "token": self._token})
        elif message_class == "VERSION":
            self.greeted = True
            self._send({"class": "WATCH"})

    def _send(self, message: dict[str, Any]) -> None:
        assert self._socket is not None
        try:
            self._socket.sendall(json.dumps(message).encode() + b"\n")
        except OSError:
            self._heard_s = -math.inf  # closed with the next poll
