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
from dataclasses import dataclass, field

from compd.configuration import Configuration
from compd.gauge import replies_tell_whose
from compd.line_settings import Pace, PolledLineSettings
from compd.lines import polled_definition
from compd.live.acquisition import LATER_S, SLOWER

# A slave must keep the silence too before it answers; many take longer: 10 ms is usual, so plan with both.
USUAL_TURNAROUND_S = 10e-3

Traffic = Sequence[tuple[int, int]]


@dataclass(frozen=True)
class LineBudget:
    """A round on one line, which polls every gauge on it once.

    bytes : there and back. ideal_s, usual_s : duration of a round with the shortest and the usual turnaround.
    absent_s : what a round costs more when a device that is absent is asked again.
    spread_s : time from the first to the last reading of a round, with the usual turnaround; 0 behind a round trigger.
    unknown : gauges whose drivers do not say what they move; they are not in the figures.
    """

    name: str
    line: PolledLineSettings
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
    name: str, line: PolledLineSettings, gauges: Mapping[str, Traffic | None], tells_whose: bool = True
) -> LineBudget:
    """The budget of one line; `gauges`: name -> traffic per poll as (bytes sent, bytes received), None = unknown.

    tells_whose : whether replies on this line say whose they are.
    """
    kind = polled_definition(line)
    gauges = {
        name: traffic and [kind.bytes_on_wire(*exchange) for exchange in traffic] for name, traffic in gauges.items()
    }
    known: list[tuple[int, int]] = [exchange for traffic in gauges.values() for exchange in traffic or ()]
    fastest, slowest = kind.pace(line), kind.pace(line, USUAL_TURNAROUND_S)
    trigger_s = kind.trigger_s(line) if known else 0.0
    usual_s = [slowest.exchange_s(*exchange) for exchange in known]
    wait_s = kind.absent_wait_s(line)
    absent_s = max(
        (wait_s - slowest.exchange_s(0, traffic[0][1]) for traffic in gauges.values() if traffic), default=wait_s
    )
    return LineBudget(
        name=name,
        line=line,
        gauges=len(gauges),
        exchanges=len(known),
        bytes=sum(sent + received for sent, received in known),
        ideal_s=trigger_s + fastest.round_s(known) + (0.0 if tells_whose else _silence_s(fastest, known)),
        usual_s=trigger_s + sum(usual_s) + (0.0 if tells_whose else _silence_s(slowest, known)),
        absent_s=absent_s,
        spread_s=0.0 if line.round_trigger is not None else sum(usual_s) - min(usual_s, default=0.0),
        unknown=tuple(gauge for gauge, traffic in gauges.items() if traffic is None),
    )


def _silence_s(line_pace: Pace, traffic: Traffic) -> float:
    """Time (s) of listening to the line at the end of a round (`compd.live.acquisition.reply_order`)."""
    longest_s = max((line_pace.exchange_s(sent, received) for sent, received in traffic), default=0.0)
    return SLOWER * longest_s + LATER_S


def gauges_on(configuration: Configuration, line: str) -> list[str]:
    """Names of the gauges on the line of this name."""
    return [gauge for gauge, options in configuration.gauges.items() if options.line == line]


def least_exchanges_s(configuration: Configuration) -> dict[str, dict[str, float]]:
    """By line and gauge, the shortest time (s) from one reading of the gauge to that of another on the line.

    Without lines of a round trigger, which read all at once, and without gauges whose traffic is not known.
    """
    gauges = configuration.gauge_objects()
    least_s: dict[str, dict[str, float]] = {}
    for name, line in configuration.lines.items():
        if not isinstance(line, PolledLineSettings) or line.round_trigger is not None:
            continue
        kind = polled_definition(line)
        traffic = {gauge: gauges[gauge].traffic() for gauge in gauges_on(configuration, name)}
        least_s[name] = {
            gauge: sum(kind.pace(line).exchange_s(*kind.bytes_on_wire(*exchange)) for exchange in exchanges)
            for gauge, exchanges in traffic.items()
            if exchanges
        }
    return least_s


def line_budgets(configuration: Configuration) -> list[LineBudget]:
    """The budget of every line that polls a gauge."""
    gauges = configuration.gauge_objects()
    budgets = []
    for name, line in configuration.lines.items():
        if not isinstance(line, PolledLineSettings):
            continue
        if on_line := {gauge: gauges[gauge] for gauge in gauges_on(configuration, name)}:
            traffic = {gauge: driver.traffic() for gauge, driver in on_line.items()}
            budgets.append(budget_of_line(name, line, traffic, replies_tell_whose(list(on_line.values()))))
    return budgets
