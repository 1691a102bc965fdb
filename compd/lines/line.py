"""What every open line has, whatever it carries; the rest is between the line and its drivers."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from compd.lines.port import Port

# Puts another port around a line's own, for instance one that shows every byte.
WrapPort = Callable[["Port"], "Port"]


class Line(Protocol):
    """An open line: a stream of bytes, a Modbus master, a subscriber."""

    @property
    def last_request_s(self) -> float:
        """Monotonic time of the last request, s; -inf before the first, and where a reply names its request."""

    @property
    def unexpected_bytes(self) -> int:
        """Bytes that came without a request, since the line was opened."""

    @property
    def request_came_back(self) -> bool:
        """Whether the first bytes that came after the last request are that request."""

    def drain(self, quiet_s: float | None = None) -> bytes:
        """Wait until nothing has come for `quiet_s`, the line's timeout if None; what came."""

    def close(self) -> None:
        """Close the line."""


def unchanged(port: Port) -> Port:
    """The port itself."""
    return port
