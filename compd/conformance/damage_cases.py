"""Replies with small damage: each bit flipped, each byte lost or doubled."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from compd.conformance import faults
from compd.conformance.case_result import (
    BY_TCP,
    DAMAGED,
    GOOD,
    IN_VIRTUAL_TIME,
    NO_ANSWER,
    Case,
    CaseResult,
    Subject,
    result_of,
    violations_of,
)
from compd.conformance.faults import Fault
from compd.conformance.harness import ConformanceSession
from compd.conformance.peer import Exchange
from compd.gauge import Quality


def _bit_flips(session: ConformanceSession, subject: Subject) -> CaseResult:
    """Every single bit of a reply flipped, one at a time."""
    case = "one bit turned"
    if subject.over_tcp:
        return CaseResult(case, "", BY_TCP, "-")
    if not subject.exact:
        return CaseResult(case, "", f"every bit: {IN_VIRTUAL_TIME}", "-")
    bits = 8 * session.wire.peer.longest
    return _damaged(session, subject, case, [[faults.flipped(bit)] for bit in range(bits)], "set a parity")


def _bytes_lost(session: ConformanceSession, subject: Subject) -> CaseResult:
    """Each byte of a reply lost, lost with all before it, or doubled."""
    case = "bytes lost, or twice"
    if subject.over_tcp:
        return CaseResult(case, "", BY_TCP, "-")
    if not subject.exact:
        return CaseResult(case, "", f"every byte: {IN_VIRTUAL_TIME}", "-")
    tries: list[Sequence[Fault]] = []
    for number, exchange in enumerate(good_poll(session)):
        for index in range(len(exchange.reply)):
            tries += [
                fault_at(number, fault)
                for fault in (faults.lost(index), faults.lost(0, index), faults.lost(index, 2), faults.repeated(index))
            ]
    return _damaged(session, subject, case, tries, "describe the number's exact width, where it has one")


def _damaged(
    session: ConformanceSession, subject: Subject, case: str, tries: Sequence[Sequence[Fault]], advice: str
) -> CaseResult:
    """Replies with small damage: a number counts only if the device itself would have sent these bytes."""
    violations, after, undetectable = [], [], []
    for reply_faults, sign in itertools.product(tries, (1.0, -1.0)):
        name = reply_faults[-1].name
        _advance_on_one_side(session, sign)
        poll = session.poll(reply_faults, new_values=False)
        delivered = ", ".join(repr(exchange.delivered) for exchange in session.exchanges)
        violations += [f"{name}: {text}: {delivered} is no reply of the device" for text in poll.wrong]
        undetectable += [f"{name}: {text}: {delivered}" for text in poll.undetectable]
        if Quality.DRIVER_ERROR in poll.qualities:
            violations.append(f"{name}: {poll}: {delivered}")
        after += [f"after {name}: {text}" for text in violations_of(session.recover()[1], GOOD)]
    if subject.checksum:
        violations += undetectable
    if undetectable and not (after or violations):
        text = f"{len(undetectable)} of {2 * len(tries)} give another number that the device could have sent"
        return CaseResult(
            case, "no wrong number, with a checksum", f"{text}: not detectable on this wire, {advice}", "-"
        )
    return result_of(
        case, DAMAGED | NO_ANSWER | GOOD, f"{2 * len(tries)} of them, no wrong number", after or violations
    )


def _advance_on_one_side(session: ConformanceSession, sign: float) -> None:
    """New values, all of one sign if the device can show them, so that a lost minus is noticed."""
    session.sensors.advance()
    for name, value in session.sensors.values.items():
        lowest, highest = session.sensors.whole.get(name, session.sensors.extents[name])
        if lowest <= sign * abs(value) <= highest:
            session.sensors.values[name] = sign * abs(value)


def good_poll(session: ConformanceSession) -> Sequence[Exchange]:
    """The exchanges of a poll without faults."""
    session.recover()
    if session.wire.pause_s:  # the first poll after a fault has two lines: a pending one, and its own
        session.poll()
    return tuple(session.exchanges)


def fault_at(number: int, fault: Fault) -> Sequence[Fault]:
    """The fault for one of a poll's replies, counted from 0."""
    return [*[faults.NONE] * number, fault]


DAMAGE_CASES: tuple[Case, ...] = (_bit_flips, _bytes_lost)
