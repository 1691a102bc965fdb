"""A device that speaks unasked: half a line is no line, and of several that have come the newest counts."""

from __future__ import annotations

from compd.commissioning.conformance.case_result import GOOD, CaseResult, complaints_of, result_of
from compd.commissioning.conformance.harness import ConformanceSession
from compd.commissioning.conformance.peer import GOLDEN
from compd.commissioning.conformance.virtual import VirtualWire

PLACES = 40  # in a line and the pause behind it, at which the line is opened
CHARACTER_S = 10 / 9600  # so that a line takes about as long as the pause behind it
PERIODS_APART = (3, 10, 100)  # from one poll to the next
RESTS_BEFORE_A_PLACE = 3  # periods: what has been said since then has the sensors' present values


def opened_within_a_line(session: ConformanceSession, wire: VirtualWire) -> CaseResult:
    """The line is opened at any place of what the device says."""
    complaints = []
    session.recover()
    for index in range(PLACES):
        period_s = wire.pause_s + wire.peer.longest * wire.character_s
        session.reopen()
        session.sensors.advance()
        wire.rest((RESTS_BEFORE_A_PLACE + index * GOLDEN % 1.0) * period_s)
        complaints += complaints_of(session.poll(new_values=False), GOOD)
    return result_of("opened within a line", GOOD, f"ok, at {PLACES} places", complaints)


def seldom_read(session: ConformanceSession, wire: VirtualWire) -> CaseResult:
    """Polled seldom: what waits is old."""
    complaints = []
    session.recover()
    for periods in PERIODS_APART:
        wire.rest((periods + 0.5) * wire.pause_s)
        texts = complaints_of(session.poll(), GOOD)
        complaints += [f"{periods} lines later: {text}" for text in texts]
    return result_of("polled seldom: the newest line", GOOD, "ok", complaints)
