"""Times on a line: of a character, of the silence before a request, of an exchange.

exchange = quiet + (sent + received) x character + turnaround
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

# Silence before a request on any serial line, in characters, as Modbus RTU asks (Serial Line V1.02, 2.5.1.1).
QUIET_CHARACTERS = 3.5
MIN_QUIET_RTU_S = 1.75e-3  # the same, above 19200 baud
MIN_QUIET_ASCII_S = 1e-3
# An FTDI adapter hands over a packet that is not full when its latency timer has run out: 16 ms, if nobody shortens it
# (FTDI AN232B-04, "Data Throughput, Latency and Handshaking").
LATENCY_TIMER_S = 16e-3
# Over Ethernet: a packet there and back through a device's firmware. No bits to count.
TCP_EXCHANGE_S = 2e-3


@dataclass(frozen=True)
class Pace:
    """Times on a line, s.

    character_s : of one character, 0 over a network.
    quiet_s : silence before a request.
    turnaround_s : from a request's last bit to the reply's first.
    """

    character_s: float
    quiet_s: float
    turnaround_s: float

    def exchange_s(self, sent: int, received: int) -> float:
        """One request of `sent` bytes and its reply of `received` bytes, s."""
        return self.quiet_s + (sent + received) * self.character_s + self.turnaround_s

    def round_s(self, traffic: Sequence[tuple[int, int]]) -> float:
        """All exchanges of a round, s."""
        return sum(self.exchange_s(sent, received) for sent, received in traffic)


def character_bits(form: str) -> int:
    """Bits of one character on the wire: start, data, parity, stop; "8N1" has 10, "7E2" 11."""
    return 1 + int(form[0]) + (form[1] != "N") + int(form[2])


def serial_pace(baud: int, form: str, rtu: bool, turnaround_s: float | None = None) -> Pace:
    """A serial line's pace. `turnaround_s`: never shorter than the silence that a device must keep; None for that."""
    character_s = character_bits(form) / baud
    quiet_s = max(QUIET_CHARACTERS * character_s, MIN_QUIET_RTU_S if rtu else MIN_QUIET_ASCII_S)
    return Pace(character_s, quiet_s, max(quiet_s, turnaround_s or 0.0))


def network_pace(pause_s: float, turnaround_s: float | None = None) -> Pace:
    """The pace of a line over Ethernet. `pause_s`: from a reply to the next request, s."""
    return Pace(0.0, pause_s, TCP_EXCHANGE_S if turnaround_s is None else max(turnaround_s, TCP_EXCHANGE_S))
