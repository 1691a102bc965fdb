"""Faults of a wire: each turns the bytes of a reply into pieces with arrival times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from pymodbus.framer.rtu import FramerRTU

# Outside numbers, names and terminators: digits would pass on a wire without checksum.
GARBAGE = b"\xf8\x00\x23"
MBAP_LENGTH = 7  # transaction, protocol, length, unit of a Modbus TCP frame


class Piece(NamedTuple):
    """Bytes that arrive `delay_s` later than the reply would have."""

    delay_s: float
    data: bytes


@dataclass(frozen=True)
class Fault:
    """`act(reply, timeout_s)`: the pieces that come in place of `reply`; `timeout_s` is the line's.

    only_of_answers : harmless where a device sends unsolicited readings: it is another line, as good as any.
    """

    name: str
    act: Callable[[bytes, float], Sequence[Piece]]
    only_of_answers: bool = False

    def __repr__(self) -> str:
        return f"Fault({self.name})"


def _at(reply: bytes, fraction: float) -> int:
    """A place inside the reply: neither before its first nor after its last byte."""
    return min(max(1, round(fraction * len(reply))), max(1, len(reply) - 1))


NONE = Fault("none", lambda reply, _: [Piece(0.0, reply)])
SILENT = Fault("no reply", lambda reply, _: [])


def garbage_before(junk: bytes = GARBAGE) -> Fault:
    return Fault(f"garbage {junk.hex(' ')} before", lambda reply, _: [Piece(0.0, junk + reply)])


def garbage_inside(fraction: float = 0.5, junk: bytes = GARBAGE) -> Fault:
    return Fault(
        f"garbage {junk.hex(' ')} at {fraction:.2f}",
        lambda reply, _: [Piece(0.0, reply[: _at(reply, fraction)] + junk + reply[_at(reply, fraction) :])],
    )


def garbage_after(junk: bytes = GARBAGE) -> Fault:
    return Fault(f"garbage {junk.hex(' ')} after", lambda reply, _: [Piece(0.0, reply + junk)])


def late(timeouts: float) -> Fault:
    """The whole reply, `timeouts` line timeouts too late."""
    return Fault(f"late by {timeouts:.2f} timeouts", lambda reply, s: [Piece(timeouts * s, reply)], True)


def split(fraction: float = 0.5, timeouts: float = 0.3) -> Fault:
    """In two parts, the second `timeouts` line timeouts after the first."""

    def act(reply: bytes, timeout_s: float) -> Sequence[Piece]:
        place = _at(reply, fraction)
        return [Piece(0.0, reply[:place]), Piece(timeouts * timeout_s, reply[place:])]

    return Fault(f"split at {fraction:.2f}, {timeouts:.2f} timeouts apart", act)


def doubled() -> Fault:
    return Fault("doubled", lambda reply, _: [Piece(0.0, reply + reply)], True)


def cut(fraction: float = 0.5) -> Fault:
    """The rest of the reply is lost."""
    return Fault(f"cut at {fraction:.2f}", lambda reply, _: [Piece(0.0, reply[: _at(reply, fraction)])])


def flipped(bit: int) -> Fault:
    """One bit flipped; `bit` counts through the reply, modulo its length."""

    def act(reply: bytes, _: float) -> Sequence[Piece]:
        place, mask = (bit // 8) % len(reply), 1 << bit % 8
        return [Piece(0.0, reply[:place] + bytes([reply[place] ^ mask]) + reply[place + 1 :])]

    return Fault(f"bit {bit} turned", act)


def lost(index: int, count: int = 1) -> Fault:
    """`count` bytes from `index` on are lost; both count through the reply."""

    def act(reply: bytes, _: float) -> Sequence[Piece]:
        return [Piece(0.0, reply[:index] + reply[index + count :])]

    return Fault(f"{count} byte{'s' * (count != 1)} lost from byte {index} on", act)


def repeated(index: int) -> Fault:
    """The byte at `index` is doubled."""
    return Fault(f"byte {index} twice", lambda reply, _: [Piece(0.0, reply[: index + 1] + reply[index:])])


def replaced(data: bytes) -> Fault:
    """Other bytes in place of the reply."""
    return Fault(f"{data!r} in its place", lambda reply, _: [Piece(0.0, data)])


ForgedPart = Literal["unit", "function", "length", "transaction"]


def forged(what: ForgedPart, over_tcp: bool) -> Fault:
    """A whole Modbus reply, checksum right, to something else than what was asked."""

    def act(reply: bytes, _: float) -> Sequence[Piece]:
        if over_tcp:
            header, message = reply[:MBAP_LENGTH], _other(reply[MBAP_LENGTH - 1 :], what)[1:]
            unit = header[6] % 247 + 1 if what == "unit" else header[6]
            transaction = int.from_bytes(header[:2], "big") - (what == "transaction")
            length = (len(message) + 1).to_bytes(2, "big")
            return [
                Piece(0.0, (transaction % 0x10000).to_bytes(2, "big") + header[2:4] + length + bytes([unit]) + message)
            ]
        frame = _other(reply[:-2], what)
        return [Piece(0.0, frame + FramerRTU.compute_CRC(frame).to_bytes(2, "big"))]

    return Fault(f"wrong {what}", act)


def refused(code: int, over_tcp: bool) -> Fault:
    """The slave's exception `code` in place of its reply."""

    def act(reply: bytes, _: float) -> Sequence[Piece]:
        start = MBAP_LENGTH - 1 if over_tcp else 0
        frame = bytes([reply[start], reply[start + 1] & 0x7F | 0x80, code])
        if over_tcp:
            return [Piece(0.0, reply[:4] + len(frame).to_bytes(2, "big") + frame)]
        return [Piece(0.0, frame + FramerRTU.compute_CRC(frame).to_bytes(2, "big"))]

    return Fault(f"exception {code}", act)


def _other(frame: bytes, what: ForgedPart) -> bytes:
    """Unit, function, byte count, registers: with one of them another one."""
    unit, function, count, registers = frame[0], frame[1], frame[2], frame[3:]
    match what:
        case "unit":
            unit = unit % 247 + 1
        case "function":
            function = 3 if function == 4 else 4
        case "length":
            count, registers = count + 2, registers + b"\x12\x34"
        case "transaction":
            pass  # the header's affair
    return bytes([unit, function, count & 0xFF]) + registers
