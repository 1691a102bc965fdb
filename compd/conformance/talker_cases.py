"""A device that sends unsolicited readings: a partial line is discarded, and the newest of several lines counts."""

from __future__ import annotations

from compd.conformance.case_result import GOOD, CaseResult, result_of, violations_of
from compd.conformance.harness import ConformanceSession
from compd.conformance.peer import GOLDEN
from compd.conformance.virtual import VirtualWire

PLACES = 40  # positions in a line and the pause behind it at which the line is opened
CHARACTER_S = 10 / 9600  # makes a line about as long as the pause behind it
PERIODS_APART = (3, 10, 100)  # periods from one poll to the next
RESTS_BEFORE_A_PLACE = 3  # periods after which lines have the sensors' present values


def opened_within_a_line(session: ConformanceSession, wire: VirtualWire) -> CaseResult:
    """The line is opened at any position of the device's output."""
    violations = []
    session.recover()
    for place in range(PLACES):
        period_s = wire.pause_s + wire.peer.longest * wire.character_s
        session.reopen()
        session.sensors.advance()
        wire.rest((RESTS_BEFORE_A_PLACE + place * GOLDEN % 1.0) * period_s)
        violations += violations_of(session.poll(new_values=False), GOOD)
    return result_of("opened within a line", GOOD, f"ok, at {PLACES} places", violations)


def seldom_read(session: ConformanceSession, wire: VirtualWire) -> CaseResult:
    """Polled seldom: waiting lines are old."""
    violations = []
    session.recover()
    for periods in PERIODS_APART:
        wire.rest((periods + 0.5) * wire.pause_s)
        texts = violations_of(session.poll(), GOOD)
        violations += [f"{periods} lines later: {text}" for text in texts]
    return result_of("polled seldom: the newest line", GOOD, "ok", violations)
