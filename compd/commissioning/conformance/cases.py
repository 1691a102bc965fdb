"""The cases: what happens on the wire, the quality that the driver must then give, and the one that it gave."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from compd.commissioning.conformance import faults
from compd.commissioning.conformance.faults import Fault
from compd.commissioning.conformance.harness import ASKED_AGAIN_TIMEOUTS, ConformanceSession, Poll
from compd.gauge import Quality

# What a damaged reply may give. OK is allowed where the driver finds the whole reply in the damage: it must be right.
DAMAGED = frozenset({Quality.MISMATCH, Quality.CRC, Quality.INCOMPLETE})
NO_ANSWER = frozenset({Quality.TIMEOUT, Quality.SILENT})
NO_VALUE = frozenset(
    {Quality.SENSOR_FAULT, Quality.OVER_RANGE, Quality.UNDER_RANGE, Quality.NOT_FINITE, Quality.DEVICE_ERROR}
)
GOOD = frozenset({Quality.OK})
EXCEPTIONS = (1, 2, 3, 4, 6, 11)  # of Modbus, those that a slave or gateway answers a read with

ENDS_OF_MAPS = (2, 3, 4)  # of them, those with which slaves answer where their registers end

BY_TCP = "TCP's own checksum keeps it from the driver"

REAL_TIME_TRIES = 3
MOST_EXCHANGES = 64  # no driver makes more in one poll

Verdict = Literal["pass", "FAIL", "-"]


@dataclass(frozen=True)
class CaseResult:
    """One line of the report: required and observed qualities. Verdict "-": cannot be tried on this wire, and why."""

    case: str
    required: str
    observed: str
    verdict: Verdict


@dataclass(frozen=True)
class Subject:
    """The driver and the wire that it is tried on, as far as the cases depend on them.

    registers : a Modbus driver, else one on a line of bytes.
    over_tcp : TCP's own checksum keeps damage from the driver.
    checksum : the protocol has one of its own.
    exact : in virtual time; cases that need thousands of polls run there alone.
    error_replies : whole replies by which the device reports an error, and the quality that must come.
    """

    registers: bool
    over_tcp: bool
    checksum: bool
    exact: bool
    error_replies: Mapping[bytes, Quality]

    @property
    def tries(self) -> int:
        """How often a case is tried until it counts as failed; in virtual time nothing is late by chance."""
        return 1 if self.exact else REAL_TIME_TRIES


def run_cases(session: ConformanceSession, subject: Subject) -> list[CaseResult]:
    """Every case in turn; a driver whose fault-free readings are wrong is tried no further."""
    required = "every channel within 1 % of its range"
    for _ in range(subject.tries):
        fault = session.calibrate()
        if fault is None:
            break
        session.settle()
    if fault is not None:
        return [CaseResult("units and scale", required, fault, "FAIL")]
    off = ", ".join(sorted({f"{tolerance / 2:.2g}" for tolerance in session.tolerance.values()}))
    results = [CaseResult("units and scale", required, f"largest differences {off}", "pass")]
    results += [run_case(case, session, subject) for case in CASES]
    if subject.registers and not subject.over_tcp:
        results += [run_case(case, session, subject) for case in CASES_ON_RTU]
    return results


def run_case(case: Case, session: ConformanceSession, subject: Subject) -> CaseResult:
    """In real time a case that fails is tried again: a busy computer is late by chance, a wrong driver wrong always."""
    late: list[str] = []
    for _ in range(subject.tries):
        result = case(session, subject)
        if result.verdict != "FAIL":
            break
        late.append(result.observed)
        session.settle()
        session.recover()
    if late and result.verdict != "FAIL":
        return replace(result, observed=f"{result.observed}; at try {len(late) + 1}, after: {late[0]}")
    return result


def _faulty_polls(
    session: ConformanceSession, case: str, allowed: frozenset[Quality], tries: Sequence[Sequence[Fault]]
) -> CaseResult:
    """One poll under each of `tries` (the faults of its replies), each followed by polls until all is good again."""
    qualities: set[str] = set()
    complaints: list[str] = []
    slowest = 0
    for reply_faults in tries:
        poll = session.poll(reply_faults)
        qualities |= {str(quality) for quality in poll.qualities}
        recovering, good = session.recover()
        slowest = max(slowest, recovering)
        complaints += [f"{reply_faults[0].name}: {text}" for text in _complaints(poll, allowed)]
        complaints += [f"after {reply_faults[0].name}: {text}" for text in _complaints(good, GOOD)]
    text = ", ".join(sorted(qualities)) + f"; right again after {slowest} poll{'s' * (slowest != 1)}"
    return _result(case, allowed, text, complaints)


def _result(case: str, allowed: frozenset[Quality], observed: str, complaints: Sequence[str]) -> CaseResult:
    required = " | ".join(str(quality) for quality in Quality if quality in allowed)
    if complaints:
        more = f" (and {len(complaints) - 1} more)" if len(complaints) > 1 else ""
        return CaseResult(case, required, complaints[0] + more, "FAIL")
    return CaseResult(case, required, observed, "pass")


def _complaints(poll: Poll, allowed: frozenset[Quality]) -> list[str]:
    unwanted = poll.qualities - allowed
    return [*poll.wrong, *([str(poll)] if unwanted and not poll.wrong else [])]


def _every_reply(fault: Fault) -> Sequence[Fault]:
    """The fault for each of the replies of one poll."""
    return [fault] * MOST_EXCHANGES


def _one_poll_each(*tried_faults: Fault) -> list[Sequence[Fault]]:
    return [_every_reply(fault) for fault in tried_faults]


def _ends_of_range(session: ConformanceSession, _: Subject) -> CaseResult:
    complaints = []
    for end in (0, 1):
        session.sensors.set_to_end(end)
        complaints += _complaints(session.poll(new_values=False), GOOD)
    return _result("range: lowest and highest value", GOOD, "ok", complaints)


def _sensor_off(session: ConformanceSession, _: Subject) -> CaseResult:
    """Each sensor off in turn: it must have no number, the others none that is wrong."""
    observed: set[str] = set()
    complaints = []
    for place, channel in enumerate(session.gauge.channels):
        session.sensors.advance()
        session.sensors.values[channel.name] = math.nan
        poll = session.poll(new_values=False)
        quality = poll.readings[place].quality
        observed.add(str(quality))
        complaints += [f"{channel.name} off: {text}" for text in poll.wrong]
        if quality not in NO_VALUE | NO_ANSWER:
            complaints.append(f"{channel.name} off: {poll}")
    complaints += _complaints(session.recover()[1], GOOD)
    return _result("a sensor is off", NO_VALUE, ", ".join(sorted(observed)), complaints)


def _time_stamp(session: ConformanceSession, _: Subject) -> CaseResult:
    """The harness checks every stamp of every poll; here the reply takes long to come."""
    return _faulty_polls(session, "time stamp: when asked, not when answered", GOOD, _one_poll_each(faults.late(0.5)))


def _no_reply(session: ConformanceSession, _: Subject) -> CaseResult:
    return _faulty_polls(session, "no reply", NO_ANSWER, _one_poll_each(faults.SILENT))


def _garbage_before(session: ConformanceSession, _: Subject) -> CaseResult:
    tries = _one_poll_each(*(faults.garbage_before(junk) for junk in (faults.GARBAGE, b"\xff", b"\r\n")))
    return _faulty_polls(session, "garbage before the reply", DAMAGED | GOOD | NO_ANSWER, tries)


def _garbage_inside(session: ConformanceSession, subject: Subject) -> CaseResult:
    case = "garbage inside the reply"
    if subject.registers and subject.over_tcp:
        return CaseResult(case, "", BY_TCP, "-")
    tries = _one_poll_each(*(faults.garbage_inside(share) for share in (0.1, 0.5, 0.9)))
    return _faulty_polls(session, case, DAMAGED | NO_ANSWER, tries)


def _garbage_after(session: ConformanceSession, _: Subject) -> CaseResult:
    return _faulty_polls(session, "garbage after the reply", DAMAGED | GOOD, _one_poll_each(faults.garbage_after()))


def _late(session: ConformanceSession, _: Subject) -> CaseResult:
    return _faulty_polls(session, "late: after the timeout", NO_ANSWER, [[faults.late(1.5)], [faults.late(3.5)]])


def _later(session: ConformanceSession, subject: Subject) -> CaseResult:
    """So late that it comes while the next request waits for its own reply, which takes its time, too.

    A timeout, the drain after it and the rest are over by then: a device can hardly be later.
    """
    case = "late: into the next request"
    if not subject.exact:
        return CaseResult(case, "", "in virtual time", "-")
    allowed = NO_ANSWER | DAMAGED | GOOD
    complaints = []
    observed: set[str] = set()
    for timeouts in (ASKED_AGAIN_TIMEOUTS + share for share in (0.3, 0.6)):
        for delay in (timeouts, 0.9):
            poll = session.poll([faults.late(delay)])
            observed |= {str(quality) for quality in poll.qualities}
            complaints += [f"late by {timeouts} timeouts: {text}" for text in _complaints(poll, allowed)]
        session.settle()
        complaints += _complaints(session.recover()[1], GOOD)
    if complaints and not subject.registers:
        return CaseResult(case, "", f"not detectable on this wire, {complaints[0]}", "-")
    return _result(case, allowed, ", ".join(sorted(observed)), complaints)


def _split(session: ConformanceSession, _: Subject) -> CaseResult:
    return _faulty_polls(
        session, "split in two", GOOD, _one_poll_each(faults.split(0.2), faults.split(0.5), faults.split(0.95))
    )


def _doubled(session: ConformanceSession, _: Subject) -> CaseResult:
    return _faulty_polls(session, "doubled", DAMAGED | GOOD, _one_poll_each(faults.doubled()))


def _cut(session: ConformanceSession, _: Subject) -> CaseResult:
    tries = _one_poll_each(*(faults.cut(share) for share in (0.0, 0.4, 0.8)))
    return _faulty_polls(session, "cut", DAMAGED | NO_ANSWER, tries)


def _bit_flips(session: ConformanceSession, subject: Subject) -> CaseResult:
    """Every single bit of a reply turned, one at a time."""
    case = "one bit turned"
    if subject.over_tcp:
        return CaseResult(case, "", BY_TCP, "-")
    if not subject.exact:
        return CaseResult(case, "", "every bit: in virtual time", "-")
    bits = 8 * session.wire.peer.longest
    wrong = []
    for bit in range(bits):
        poll = session.poll([faults.flipped(bit)])
        wrong += [f"bit {bit}: {text}" for text in poll.wrong[:1]]
        wrong += [f"after bit {bit}: {text}" for text in _complaints(session.recover()[1], GOOD)]
    after = [text for text in wrong if text.startswith("after")]
    if wrong and not after and not subject.checksum:
        text = f"{len(wrong)} of {bits} give another number: not detectable on this wire, set a parity"
        return CaseResult(case, "no wrong number, with a checksum", text, "-")
    return _result(case, DAMAGED | NO_ANSWER | GOOD, f"{bits} bits, no wrong number", after or wrong)


def _forged(session: ConformanceSession, subject: Subject) -> CaseResult:
    case = "wrong unit, function, length"
    if not subject.registers:
        foreign = faults.replaced(b"\x01\x84\x02\xc2\xc1\r\n")
        return _faulty_polls(session, "another device's reply", DAMAGED | NO_ANSWER, _one_poll_each(foreign))
    kinds: list[faults.Forgery] = ["unit", "function", "length"]
    if subject.over_tcp:
        kinds.append("transaction")
    tries = _one_poll_each(*(faults.forged(kind, subject.over_tcp) for kind in kinds))
    return _faulty_polls(session, case, DAMAGED | (NO_ANSWER if subject.over_tcp else frozenset()), tries)


def _errors(session: ConformanceSession, subject: Subject) -> CaseResult:
    case = "error replies"
    if subject.registers:
        tries = _one_poll_each(*(faults.refused(code, subject.over_tcp) for code in EXCEPTIONS))
        return _faulty_polls(session, case, frozenset({Quality.DEVICE_ERROR}), tries)
    if not subject.error_replies:
        return CaseResult(case, "", "the simulated device names none in `error_replies`", "-")
    results = [
        _faulty_polls(session, case, frozenset({quality}), _one_poll_each(faults.replaced(reply)))
        for reply, quality in subject.error_replies.items()
    ]
    return next((result for result in results if result.verdict != "pass"), results[-1])


def _end_of_map(session: ConformanceSession, _: Subject) -> CaseResult:
    """A slave whose registers end behind the last one that is read, which the line asks beyond: it must learn that."""
    complaints = []
    for beyond in (faults.SILENT, *(faults.refused(code, over_tcp=False) for code in ENDS_OF_MAPS)):
        session.reopen()
        session.wire.peer.end_map(beyond)
        polls = [session.poll()]
        learning = 2 * session.wire.peer.blocks + 1
        polls += [session.poll() for _ in range(learning)]
        complaints += [f"{beyond.name}: {text}" for poll in polls for text in poll.wrong]
        last = [session.poll() for _ in range(learning)]
        complaints += [f"{beyond.name}, still: {text}" for poll in last for text in _complaints(poll, GOOD)]
    session.wire.peer.end_map(None)
    session.reopen()
    return _result("the map ends: silent, exceptions 2, 3, 4", GOOD, "ok, once the line knows", complaints)


def _unplugged(session: ConformanceSession, _: Subject) -> CaseResult:
    session.poll()
    session.wire.unplug()
    polls = [session.poll(), session.poll()]
    session.wire.replug()
    count, good = session.recover()
    lost = frozenset({Quality.LINE_LOST})
    complaints = [text for poll in polls for text in _complaints(poll, lost | NO_ANSWER)]
    if Quality.LINE_LOST not in polls[1].qualities:
        complaints.append(f"still {polls[1]} at the second poll")
    complaints += [f"replugged: {text}" for text in _complaints(good, GOOD)]
    return _result(
        "unplugged, replugged", lost, f"line_lost; right again after {count} poll{'s' * (count != 1)}", complaints
    )


Case = Callable[[ConformanceSession, Subject], CaseResult]
CASES: Sequence[Case] = (
    _ends_of_range,
    _sensor_off,
    _time_stamp,
    _no_reply,
    _garbage_before,
    _garbage_inside,
    _garbage_after,
    _late,
    _later,
    _split,
    _doubled,
    _cut,
    _bit_flips,
    _forged,
    _errors,
    _unplugged,
)
CASES_ON_RTU: Sequence[Case] = (_end_of_map,)


def slowest_line(session: ConformanceSession, baud: int) -> CaseResult:
    """A wire at its lowest speed: replies take long and are whole."""
    polls = [session.poll(), session.poll()]
    return _result(f"the line at {baud} baud", GOOD, "ok", [text for poll in polls for text in _complaints(poll, GOOD)])
