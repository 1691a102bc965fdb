"""The far end of a serial port: a pty, or a listening socket behind the URL socket://."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from compd.twins.wire_ends import LOOPBACK, End, PtyEnd, TcpEnd


class SocketUrlEnd(TcpEnd):
    """A listening socket that the daemon opens as a serial port, by a URL."""

    @property
    def port(self) -> str:
        return f"socket://{LOOPBACK}:{self.number}"


def serial_end(settings: Any, link: Path, number: int) -> End:
    """See `PolledTwin.end`."""
    if settings is not None and settings.behind_url:
        return SocketUrlEnd(number)
    return PtyEnd(link)


def serial_character_s(settings: Any) -> float:
    """Time of a character on a pty, s; 0 behind a URL, where the device server has the baud rate."""
    bits = 1 + int(settings.format[0]) + (settings.format[1] != "N") + int(settings.format[2])
    return 0.0 if settings.behind_url else float(bits / settings.baud)
