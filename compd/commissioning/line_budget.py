"""Capacity of a line: bytes and milliseconds of a round, and the resulting sampling rate.

This is the limit of the line itself: bits on the wire, the silence before each request, and the time that a device
takes to answer. What the computer adds is not in it.

    exchange = quiet + (sent + received) x character + turnaround,    round = sum of all exchanges,    rate = 1 / round

A round trigger and its settling time come before them. Without it the readings of a round are apart by all exchanges
but one.

Where replies do not say whose they are, a round ends with a silence that is longer than the longest exchange.

Example: nine values as int16 in one block (8 bytes there, 23 back) at 19200 baud, 8N1: a character takes 0.52 ms, the
silence 1.8 ms; with a turnaround of 1.8 ms a round takes 19.8 ms: 51 rounds a second.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from compd.configuration import (
    BROADCAST,
    WRITE_REGISTERS,
    Configuration,
    ModbusAsciiLine,
    ModbusRtuLine,
    ModbusTcpLine,
    PolledLine,
    PushedLineSettings,
    SerialPortSettings,
    TriggerBytes,
)
from compd.gauge import replies_tell_whose
from compd.lines import QUIET_CHARACTERS
from compd.live.acquisition import LATER_S, SLOWER

SHORTEST_QUIET_RTU_S = 1.75e-3  # the same, above 19200 baud
SHORTEST_QUIET_ASCII_S = 1e-3
# Usual time (s) of a slave's answer. It must keep the silence, too; many take longer, so both are planned with.
USUAL_TURNAROUND_S = 10e-3
# Latency timer (s) of an FTDI adapter, after which it hands over an incomplete packet: 16 ms by default (FTDI
# AN232B-04, "Data Throughput, Latency and Handshaking").
LATENCY_TIMER_S = 16e-3
# Time (s) of an exchange over Ethernet: a packet there and back through a device's firmware, independent of its length.
TCP_EXCHANGE_S = 2e-3

Traffic = Sequence[tuple[int, int]]


@dataclass(frozen=True)
class Pace:
    """Times on a line, s.

    character_s : of one character, 0 over TCP.
    quiet_s : silence before a request.
    turnaround_s : from a request's last bit to the reply's first.
    """

    character_s: float
    quiet_s: float
    turnaround_s: float

    def exchange_s(self, sent: int, received: int) -> float:
        """One request of `sent` bytes and its reply of `received` bytes, s."""
        return self.quiet_s + (sent + received) * self.character_s + self.turnaround_s

    def round_s(self, traffic: Traffic) -> float:
        """All exchanges of a round, s."""
        return sum(self.exchange_s(sent, received) for sent, received in traffic)


def character_bits(form: str) -> int:
    """Bits of one character on the wire: start, data, parity, stop; "8N1" has 10, "7E2" 11."""
    return 1 + int(form[0]) + (form[1] != "N") + int(form[2])


def serial_pace(baud: int, form: str, rtu: bool, turnaround_s: float | None = None) -> Pace:
    """A serial line's pace. `turnaround_s`: never shorter than the silence that a device must keep; None for that."""
    character_s = character_bits(form) / baud
    quiet_s = max(QUIET_CHARACTERS * character_s, SHORTEST_QUIET_RTU_S if rtu else SHORTEST_QUIET_ASCII_S)
    return Pace(character_s, quiet_s, max(quiet_s, turnaround_s or 0.0))


def pace(line: PolledLine, turnaround_s: float | None = None) -> Pace:
    """A configured line's pace. Behind socket:// the device server's baud rate counts: it is the configured one."""
    if isinstance(line, SerialPortSettings):
        serial = serial_pace(line.baud, line.format, isinstance(line, ModbusRtuLine), turnaround_s)
        return replace(serial, quiet_s=max(serial.quiet_s, line.pause_s))
    return Pace(0.0, line.pause_s, TCP_EXCHANGE_S if turnaround_s is None else max(turnaround_s, TCP_EXCHANGE_S))


@dataclass(frozen=True)
class LineBudget:
    """A round on one line, which polls every gauge on it once.

    bytes : there and back. ideal_s, usual_s : duration of a round with the shortest and the usual turnaround.
    absent_s : what a round costs more when a device that is absent is asked again.
    spread_s : time from the first to the last reading of a round, with the usual turnaround; 0 behind a round trigger.
    unknown : gauges whose drivers do not say what they move; they are not in the figures.
    """

    name: str
    line: PolledLine
    gauges: int
    exchanges: int
    bytes: int
    ideal_s: float
    usual_s: float
    absent_s: float
    spread_s: float = 0.0
    unknown: tuple[str, ...] = field(default=())

    @property
    def known(self) -> bool:
        """Whether any figures are known."""
        return self.exchanges > 0 and not self.unknown

    @property
    def ideal_hz(self) -> float:
        """Rounds per second at best; nan if unknown. `poll_every_s` of the line is an upper limit."""
        return self._rate_hz(self.ideal_s)

    @property
    def usual_hz(self) -> float:
        """Rounds per second with devices that take 10 ms to answer; nan if unknown."""
        return self._rate_hz(self.usual_s)

    def _rate_hz(self, round_s: float) -> float:
        return 1 / max(round_s, self.line.poll_every_s) if self.known else math.nan


def budget_of_line(
    name: str, line: PolledLine, gauges: Mapping[str, Traffic | None], tells_whose: bool = True
) -> LineBudget:
    """The budget of one line; `gauges`: name -> traffic per poll as (bytes sent, bytes received), None = unknown.

    tells_whose : whether replies on this line say whose they are.
    """
    if isinstance(line, ModbusAsciiLine):
        gauges = {name: traffic and [_as_text(*exchange) for exchange in traffic] for name, traffic in gauges.items()}
    known: list[tuple[int, int]] = [exchange for traffic in gauges.values() for exchange in traffic or ()]
    slowest = pace(line, USUAL_TURNAROUND_S)
    trigger_s = _trigger_s(line, pace(line)) if known else 0.0
    usual_s = [slowest.exchange_s(*exchange) for exchange in known]
    # A request without an answer takes the timeout, or longer behind a busy gateway.
    wait_s = max(line.timeout_s, (line.gateway_wait_s or 0.0) if isinstance(line, ModbusTcpLine) else 0.0)
    absent_s = max(
        (wait_s - slowest.exchange_s(0, traffic[0][1]) for traffic in gauges.values() if traffic), default=wait_s
    )
    return LineBudget(
        name=name,
        line=line,
        gauges=len(gauges),
        exchanges=len(known),
        bytes=sum(sent + received for sent, received in known),
        ideal_s=trigger_s + pace(line).round_s(known) + (0.0 if tells_whose else _silence_s(pace(line), known)),
        usual_s=trigger_s + sum(usual_s) + (0.0 if tells_whose else _silence_s(slowest, known)),
        absent_s=absent_s,
        spread_s=0.0 if line.round_trigger is not None else sum(usual_s) - min(usual_s, default=0.0),
        unknown=tuple(gauge for gauge, traffic in gauges.items() if traffic is None),
    )


def _trigger_s(line: PolledLine, line_pace: Pace) -> float:
    """Time (s) of a round trigger with its settling time; includes the confirmation over TCP, and of a single slave."""
    trigger = line.round_trigger
    if trigger is None:
        return 0.0
    settle_s = trigger.settle_s or 0.0
    if isinstance(trigger, TriggerBytes):
        return line_pace.quiet_s + len(trigger.request) * line_pace.character_s + settle_s
    several = trigger.function == WRITE_REGISTERS
    sent = 9 + 2 * len(trigger.values) if several else 8  # Modbus over Serial Line V1.02: with unit and CRC
    received = 8
    if isinstance(line, ModbusAsciiLine):
        (sent, received) = _as_text(sent, received)
    if trigger.unit == BROADCAST and isinstance(line, SerialPortSettings):
        return line_pace.quiet_s + sent * line_pace.character_s + settle_s
    return max(line_pace.exchange_s(sent, received), settle_s)


def _as_text(sent: int, received: int) -> tuple[int, int]:
    """Length in Modbus ASCII of an RTU frame: two digits per byte, one byte of LRC for two of CRC, : CR LF."""
    return 2 * (sent - 1) + 3, 2 * (received - 1) + 3 if received else 0


def _silence_s(line_pace: Pace, traffic: Traffic) -> float:
    """Time (s) of listening to the line at the end of a round (`compd.live.acquisition.reply_order`)."""
    longest_s = max((line_pace.exchange_s(sent, received) for sent, received in traffic), default=0.0)
    return SLOWER * longest_s + LATER_S


def gauges_on(configuration: Configuration, line: str) -> list[str]:
    """Names of the gauges on the line of this name."""
    return [gauge for gauge, options in configuration.gauges.items() if options.line == line]


def line_budgets(configuration: Configuration) -> list[LineBudget]:
    """The budget of every line that polls a gauge."""
    gauges = configuration.gauge_objects()
    budgets = []
    for name, line in configuration.lines.items():
        if isinstance(line, PushedLineSettings):
            continue
        if on_line := {gauge: gauges[gauge] for gauge in gauges_on(configuration, name)}:
            traffic = {gauge: driver.traffic() for gauge, driver in on_line.items()}
            budgets.append(budget_of_line(name, line, traffic, replies_tell_whose(list(on_line.values()))))
    return budgets
