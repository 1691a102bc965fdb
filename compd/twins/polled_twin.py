"""The far end of a polled line: its port, the devices that answer there, and what faults do to their replies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from compd.twins.device import Listener
from compd.twins.line_fault import SILENT
from compd.twins.wire_ends import End

DAMAGED_BIT = 0x80
# A fault's effect on a reply.
Damage = Callable[[bytes], bytes]
LATE = "late"


def _garble(reply: bytes) -> bytes:
    """Invert the high bit in the middle: invalid in a text protocol, and found by a CRC."""
    middle = len(reply) // 2
    return reply[:middle] + bytes([reply[middle] ^ DAMAGED_BIT]) + reply[middle + 1 :]


# Of lines of every kind.
DAMAGES: Mapping[str, Damage] = {
    SILENT: lambda reply: b"",
    "garble": _garble,
    LATE: lambda reply: reply,
    "cut": lambda reply: reply[: len(reply) // 2],
    "doubled": lambda reply: reply + reply,
    "noise before": lambda reply: b"\xff" + reply,
}


def _no_time(settings: Any) -> float:
    return 0.0


@dataclass(frozen=True)
class PolledTwin:
    """The far end of a kind of line."""

    #: opens it on this computer. Takes the line's settings, None for a port of this computer; the path at which a
    #: serial port appears; and the number of the network port, 0 for any.
    end: Callable[[Any, Path, int], End]
    listener: Callable[[Any, Sequence[Any]], Listener]  #: the devices on the line. Takes the settings and the devices.
    #: by name of a fault, what becomes of a reply
    damages: Mapping[str, Damage] = field(default_factory=lambda: DAMAGES)
    character_s: Callable[[Any], float] = _no_time  #: time (s) of a character on the wire, by the settings
