"""One client's connection: bytes in and out, nothing waited for."""

from __future__ import annotations

import math
import socket
from collections.abc import Callable, Iterator

from compd.live.loop.setpoint import Setpoint
from compd.live.service.messages import MAX_LINE_BYTES, ErrorCode, ProtocolError

# About 150 setpoints: 0.7 s at 200 Hz. A client that is further behind reads the past.
MAX_BEHIND_BYTES = 128 * 1024
# About 1500 READINGS: 1.5 s at 1 kHz. Who watches them wants the past, and they are for this computer alone.
MAX_READINGS_BEHIND_BYTES = 8 * 1024 * 1024
_RECEIVE_BYTES = 4096
_LONGEST_INTERVAL_S = 1e6


class ClientSession:
    """A connected client. Only the publisher's thread touches it."""

    def __init__(self, connection: socket.socket, name: str, local: bool) -> None:
        """`local`: came over the Unix socket, from this computer."""
        connection.setblocking(False)
        self.connection = connection
        self.name = name
        self.local = local
        self.open = True
        self.due_s = math.inf
        self.encode: Callable[[Setpoint], bytes] = Setpoint.to_json
        self._interval_s = math.inf
        self._max_behind_bytes = MAX_BEHIND_BYTES
        self._received = bytearray()
        self._skipping = False
        self._waiting = bytearray()

    def watch(self, rate_hz: float, encode: Callable[[Setpoint], bytes], max_behind_bytes: int) -> None:
        """From now on `rate_hz` setpoints per second, as `encode` writes them: inf for every one, 0 for none."""
        self.encode = encode
        self._max_behind_bytes = max_behind_bytes
        self._interval_s = min(1.0 / rate_hz, _LONGEST_INTERVAL_S) if rate_hz else math.inf
        self.due_s = -math.inf if rate_hz else math.inf

    def takes(self, time_s: float, half_period_s: float) -> bool:
        """Whether the setpoint of `time_s` is this client's next one."""
        if time_s < self.due_s - half_period_s:
            return False
        self.due_s += self._interval_s
        if self.due_s < time_s:  # the first one, or an interval was missed: count from here
            self.due_s = time_s + self._interval_s
        return True

    def receive(self) -> Iterator[bytes | ProtocolError]:
        """Whole lines that have come, and an error for each that is too long. Closes at the end of the stream."""
        try:
            data = self.connection.recv(_RECEIVE_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self.open = False
            return
        self._received += data
        *lines, rest = self._received.split(b"\n")
        self._received = rest
        for line in lines:
            if self._skipping:
                self._skipping = False
            elif len(line) > MAX_LINE_BYTES:
                yield _too_long()
            elif line.strip():
                yield bytes(line)
        if len(rest) > MAX_LINE_BYTES:
            self._received = bytearray()
            if not self._skipping:
                self._skipping = True
                yield _too_long()

    def send(self, data: bytes) -> bool:
        """Send now what the system takes and keep the rest; False when the client is too far behind."""
        if len(self._waiting) + len(data) > self._max_behind_bytes:
            return False
        self._waiting += data
        self.flush()
        return True

    def flush(self) -> None:
        """Send what waits, as far as the system takes it."""
        try:
            while self._waiting:
                del self._waiting[: self.connection.send(self._waiting)]
        except BlockingIOError:
            return
        except OSError:
            self.open = False

    @property
    def behind(self) -> bool:
        """Something waits to be sent."""
        return bool(self._waiting)

    def close(self) -> None:
        self.open = False
        self.connection.close()


def _too_long() -> ProtocolError:
    return ProtocolError(ErrorCode.LINE_TOO_LONG, f"a line has at most {MAX_LINE_BYTES} bytes")
