"""Notifications to systemd, sd_notify(3), sent by the supervisor."""

from __future__ import annotations

import math
import os
import socket
from collections.abc import Mapping

# sd_watchdog_enabled(3) asks for half the interval; a quarter leaves room for a missed cycle.
_BEATS_PER_WATCHDOG = 4


class Notifier:
    """Sends notifications to the socket of the service manager; does nothing where there is none.

    A message that the manager cannot take at once is dropped, so that nobody waits.
    """

    def __init__(self, address: str, watchdog_s: float = math.inf) -> None:
        """`address` as in $NOTIFY_SOCKET, "" for none; `watchdog_s` as in $WATCHDOG_USEC."""
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._beat_every_s = watchdog_s / _BEATS_PER_WATCHDOG
        self._next_beat_s = -math.inf if math.isfinite(watchdog_s) else math.inf
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) if address else None

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ) -> Notifier:
        """The notifier that $NOTIFY_SOCKET and $WATCHDOG_USEC ask for; $WATCHDOG_PID may name another process."""
        usec = environment.get("WATCHDOG_USEC", "")
        is_ours = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        watchdog_s = int(usec) * 1e-6 if usec.isdigit() and is_ours else math.inf
        return cls(environment.get("NOTIFY_SOCKET", ""), watchdog_s)

    def ready(self) -> None:
        """Report that the first cycle has run."""
        self._send("READY=1")

    def reloading(self, now_s: float) -> None:
        """Report that the daemon starts anew with another configuration, at the monotonic time `now_s`."""
        self._send(f"RELOADING=1\nMONOTONIC_USEC={now_s * 1e6:.0f}")

    def stopping(self) -> None:
        """Report that the daemon stops."""
        self._send("STOPPING=1")

    def status(self, text: str) -> None:
        """One line for `systemctl status`."""
        self._send("STATUS=" + text.replace("\n", " "))

    def beat(self, now_s: float) -> None:
        """Reset the watchdog, if a quarter of its interval has passed; called while the loop beats."""
        if now_s >= self._next_beat_s:
            self._next_beat_s = now_s + self._beat_every_s
            self._send("WATCHDOG=1")

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()

    def _send(self, message: str) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto(message.encode(), self._address)
        except OSError:
            return  # the manager is busy or gone; the next beat tries again
