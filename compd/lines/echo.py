"""The echo of a two-wire RS-485 adapter, which receives what it sends, and how it looks where it is unexpected.

`echo: true` of a line takes it out. Without that, the request stands where the reply should be.
"""

from __future__ import annotations

from typing import Protocol

from compd.gauge import LineFault, Quality

HINT = "the request itself came back; if the adapter repeats what it sends, write `echo: true` on the line"
# Two bytes may be a reply by chance, where the request has no more; of a longer request this many are enough.
MIN_BYTES, ENOUGH_BYTES = 2, 5
_OF_THE_REPLY = (Quality.TIMEOUT, Quality.INCOMPLETE, Quality.CRC, Quality.MISMATCH)


class EchoWatch(Protocol):
    """What is needed of a line."""

    @property
    def request_came_back(self) -> bool: ...


def is_echo(request: bytes, came: bytes) -> bool:
    """Whether the first bytes that came after a request are the request."""
    if len(came) < len(request):
        return len(came) >= ENOUGH_BYTES and request.startswith(came)
    return len(request) >= MIN_BYTES and came.startswith(request)


def explained(fault: LineFault, line: EchoWatch) -> LineFault:
    """The fault of a poll, with the hint where the echo of the request may be its cause."""
    if fault.quality in _OF_THE_REPLY and line.request_came_back:
        return LineFault(fault.quality, f"{fault.detail}; {HINT}" if fault.detail else HINT)
    return fault
