"""What every open line has, whatever it carries; the rest is between the line and its drivers."""

from __future__ import annotations

from typing import Protocol


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
