"""What a line can carry: bytes and milliseconds of a round, and the sampling rate that follows.

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

from compd.configuration import Configuration
from compd.configuration.lines import ModbusAsciiLine, ModbusRtuLine, PolledLine, SerialPortSettings
from compd.configuration.pushed_lines import PushedLineSettings
from compd.configuration.round_trigger import BROADCAST, WRITE_REGISTERS, TriggerBytes
from compd.errors import Problem
from compd.gauge import replies_tell_whose
from compd.lines.open import QUIET_CHARACTERS
from compd.live.acquisition.reply_order import LATER_S, SLOWER

SHORTEST_QUIET_RTU_S = 1.75e-3  # the same, above 19200 baud
SHORTEST_QUIET_ASCII_S = 1e-3
# A slave must keep the silence too before it answers; many take longer: 10 ms is usual, so plan with both.
USUAL_TURNAROUND_S = 10e-3
# An FTDI adapter hands over a packet that is not full when its latency timer has run out: 16 ms, if nobody shortens it
# (FTDI AN232B-04, "Data Throughput, Latency and Handshaking").
LATENCY_TIMER_S = 16e-3
# Lengths that are further apart, s, and nobody limits it or latches them: at 1 mm/s, which is slow for a machine that
# moves, 20 um, and a comparator shows a hundredth of that.
LARGEST_SPREAD_S = 0.02
# Over Ethernet: a packet there and back through a device's firmware. No bits to count.
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
        """Whether there are figures at all."""
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
    # The request goes out, and nothing comes for the timeout.
    absent_s = max(
        (line.timeout_s - slowest.exchange_s(0, traffic[0][1]) for traffic in gauges.values() if traffic),
        default=line.timeout_s,
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
    """What a round trigger takes with its settling time, s; over TCP, and to one slave alone, with its confirmation."""
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
    """Bytes in Modbus ASCII of what has so many in RTU: two digits each, one byte of LRC for two of CRC, : CR LF."""
    return 2 * (sent - 1) + 3, 2 * (received - 1) + 3 if received else 0


def _silence_s(line_pace: Pace, traffic: Traffic) -> float:
    """How long the line is listened to at the end of a round, s (`compd.live.acquisition.reply_order`)."""
    longest_s = max((line_pace.exchange_s(sent, received) for sent, received in traffic), default=0.0)
    return SLOWER * longest_s + LATER_S


def line_budgets(configuration: Configuration) -> list[LineBudget]:
    """The budget of every line that polls a gauge."""
    gauges = configuration.gauge_objects()
    budgets = []
    for name, line in configuration.lines.items():
        if isinstance(line, PushedLineSettings):
            continue
        if on_line := {gauge: gauges[gauge] for gauge in _gauges_on(configuration, name)}:
            traffic = {gauge: driver.traffic() for gauge, driver in on_line.items()}
            budgets.append(budget_of_line(name, line, traffic, replies_tell_whose(list(on_line.values()))))
    return budgets


def budget_warnings(configuration: Configuration, budgets: Sequence[LineBudget]) -> list[Problem]:
    """What will not work as configured, or will not while one device is absent."""
    problems = []
    for budget in budgets:
        stale_after_s = min(
            configuration.gauges[gauge].stale_after_s or configuration.loop.stale_after_s
            for gauge in _gauges_on(configuration, budget.name)
        )
        problems += line_warnings(budget, stale_after_s, configuration.where("lines", budget.name))
    return [*problems, *_skew_warnings(configuration, budgets)]


def _skew_warnings(configuration: Configuration, budgets: Sequence[LineBudget]) -> list[Problem]:
    """Lines whose lengths are measured far apart: beyond `loop.skew_s`, or unnoticed where that is left out."""
    allowed_s = configuration.loop.skew_s
    measuring = [budget for budget in budgets if budget.known and _measures_lengths(configuration, budget.name)]
    problems = []
    for budget in measuring:
        # just before its next reading comes, a length is a round older than the newest of another line
        skew_s = max(budget.usual_s, budget.line.poll_every_s)
        if allowed_s is not None and skew_s > allowed_s:
            problems.append(
                Problem(
                    where=configuration.where("loop", "skew_s"),
                    what=f"line `{budget.name}` takes {skew_s * 1e3:.0f} ms for a round: setpoints will be refused",
                    value=f"{allowed_s:g} s",
                    allowed=f"{skew_s:.3g} s or more",
                    next_step="raise it, or the baud rate, or spread the gauges over more lines",
                )
            )
        elif allowed_s is None and budget.spread_s > LARGEST_SPREAD_S:
            problems.append(
                Problem(
                    where=configuration.where("lines", budget.name),
                    what=f"its lengths are measured {budget.spread_s * 1e3:.0f} ms apart within a round: on the move "
                    "they do not belong together, and no setpoint is refused for it",
                    allowed=f"{LARGEST_SPREAD_S * 1e3:g} ms, or a limit",
                    next_step="set `round_trigger` where the devices can latch, or say by `loop.skew_s` how far apart "
                    "lengths may be",
                )
            )
    return problems


def _measures_lengths(configuration: Configuration, line: str) -> bool:
    """Whether a length of the wiring is read on this line."""
    wiring = configuration.wiring
    channels = [
        *(wire.gauge for wire in wiring.scale),
        *(wire.gauge for wire in wiring.joint),
        *(wire.gauge for wire in wiring.frame),
    ]
    return not {channel.split(".")[0] for channel in channels}.isdisjoint(_gauges_on(configuration, line))


def _gauges_on(configuration: Configuration, line: str) -> list[str]:
    return [gauge for gauge, options in configuration.gauges.items() if options.line == line]


def line_warnings(budget: LineBudget, stale_after_s: float, where: str) -> list[Problem]:
    """One line's warnings. `stale_after_s`: the shortest of its gauges; `where`: the line's place in the file."""
    if budget.unknown:
        text = f"cannot be planned: {', '.join(budget.unknown)} does not say how many bytes it moves"
        return [
            Problem(where=where, what=text, next_step="give the driver `traffic`, or measure with `compd gauge watch`")
        ]
    problems = []
    takes = f"a round of {budget.bytes} bytes takes {budget.usual_s * 1e3:.1f} ms with 10 ms turnaround"
    # A reading is up to a whole round old when the next one comes, and must outlive that one's own reading.
    if 2 * budget.usual_s > stale_after_s:
        problems.append(
            Problem(
                where=where,
                what=f"{takes}: readings go stale between two polls",
                value=f"{stale_after_s:g} s until stale",
                allowed=f"{2 * budget.usual_s:.3g} s or more",
                next_step="raise the baud rate, read registers in one block, or spread the gauges over more lines",
            )
        )
    if budget.line.poll_every_s and budget.usual_s > budget.line.poll_every_s:
        problems.append(
            Problem(
                where=where,
                what=f"{takes}: the wanted rate cannot be reached",
                value=f"poll_every_s {budget.line.poll_every_s:g}",
                allowed=f"{budget.usual_s:.3g} s or more",
                next_step="raise poll_every_s, or the baud rate",
            )
        )
    line = budget.line
    if isinstance(line, SerialPortSettings) and line.low_latency is False and "://" not in line.port:
        held_back_s = budget.usual_s + budget.exchanges * LATENCY_TIMER_S
        problems.append(
            Problem(
                where=where,
                what=f"an FTDI adapter holds each reply back for up to 16 ms: a round of {budget.usual_s * 1e3:.1f} ms "
                f"takes up to {held_back_s * 1e3:.1f}",
                value="low_latency: false",
                next_step="leave `low_latency` out",
            )
        )
    if budget.gauges > 1 and budget.usual_s + budget.absent_s > stale_after_s:
        problems.append(
            Problem(
                where=where,
                what=f"one absent device of {budget.gauges} delays the others by {budget.absent_s * 1e3:.0f} ms: "
                "they go stale whenever it is tried again",
                value=f"{stale_after_s:g} s until stale",
                next_step="shorten timeout_s, or give that device a line of its own",
            )
        )
    return problems
