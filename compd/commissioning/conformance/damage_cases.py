"""Replies with small damage: each bit turned, each byte lost or come twice."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from compd.commissioning.conformance import faults
from compd.commissioning.conformance.case_result import (
    BY_TCP,
    DAMAGED,
    GOOD,
    IN_VIRTUAL_TIME,
    NO_ANSWER,
    Case,
    CaseResult,
    Subject,
    complaints_of,
    result_of,
)
from compd.commissioning.conformance.faults import Fault
from compd.commissioning.conformance.harness import ConformanceSession
from compd.commissioning.conformance.peer import Exchange
from compd.gauge import Quality


def _bit_flips(session: ConformanceSession, subject: Subject) -> CaseResult:
    """Every single bit of a reply turned, one at a time."""
    case = "one bit turned"
    if subject.over_tcp:
        return CaseResult(case, "", BY_TCP, "-")
    if not subject.exact:
        return CaseResult(case, "", f"every bit: {IN_VIRTUAL_TIME}", "-")
    bits = 8 * session.wire.peer.longest
    return _damaged(session, subject, case, [[faults.flipped(bit)] for bit in range(bits)], "set a parity")


def _bytes_lost(session: ConformanceSession, subject: Subject) -> CaseResult:
    """Each byte of a reply lost, lost with all before it, or come twice."""
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
    """Replies with small damage: no number that the device would not itself have sent in these very bytes."""
    complaints, after, undetectable = [], [], []
    for reply_faults, sign in itertools.product(tries, (1.0, -1.0)):
        name = reply_faults[-1].name
        _advance_on_one_side(session, sign)
        poll = session.poll(reply_faults, new_values=False)
        delivered = ", ".join(repr(exchange.delivered) for exchange in session.exchanges)
        complaints += [f"{name}: {text}: {delivered} is no reply of the device" for text in poll.wrong]
        undetectable += [f"{name}: {text}: {delivered}" for text in poll.undetectable]
        if Quality.DRIVER_ERROR in poll.qualities:
            complaints.append(f"{name}: {poll}: {delivered}")
        after += [f"after {name}: {text}" for text in complaints_of(session.recover()[1], GOOD)]
    if subject.checksum:
        complaints += undetectable
    if undetectable and not (after or complaints):
        text = f"{len(undetectable)} of {2 * len(tries)} give another number that the device could have sent"
        return CaseResult(
            case, "no wrong number, with a checksum", f"{text}: not detectable on this wire, {advice}", "-"
        )
    return result_of(
        case, DAMAGED | NO_ANSWER | GOOD, f"{2 * len(tries)} of them, no wrong number", after or complaints
    )


def _advance_on_one_side(session: ConformanceSession, sign: float) -> None:
    """New values, all of one sign where the device can show them: a lost minus must not go unseen."""
    session.sensors.advance()
    for name, value in session.sensors.values.items():
        lowest, highest = session.sensors.whole.get(name, session.sensors.extents[name])
        if lowest <= sign * abs(value) <= highest:
            session.sensors.values[name] = sign * abs(value)


def good_poll(session: ConformanceSession) -> Sequence[Exchange]:
    """The exchanges of a poll without faults."""
    session.recover()
    if session.wire.pause_s:  # the first poll after a fault has two lines: one that was under way, and its own
        session.poll()
    return tuple(session.exchanges)


def fault_at(number: int, fault: Fault) -> Sequence[Fault]:
    """The fault for one of a poll's replies, the first being 0."""
    return [*[faults.NONE] * number, fault]


DAMAGE_CASES: tuple[Case, ...] = (_bit_flips, _bytes_lost)
