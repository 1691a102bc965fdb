"""The cases: what happens on the wire, the quality that must come, and what did."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from compd.commissioning.conformance import faults
from compd.commissioning.conformance.faults import Fault
from compd.commissioning.conformance.harness import REST_TIMEOUTS, ConformanceSession, Poll
from compd.gauge import Quality

# What a damaged reply may give. OK is allowed where the driver finds the whole reply in the damage: it must be right.
DAMAGED = frozenset({Quality.MISMATCH, Quality.CRC, Quality.INCOMPLETE})
NO_ANSWER = frozenset({Quality.TIMEOUT, Quality.SILENT})
NO_VALUE = frozenset(
    {Quality.SENSOR_FAULT, Quality.OVER_RANGE, Quality.UNDER_RANGE, Quality.NOT_FINITE, Quality.DEVICE_ERROR}
)
GOOD = frozenset({Quality.OK})
EXCEPTIONS = (1, 2, 3, 4, 6, 11)  # of Modbus, those that a slave or gateway answers a read with

BY_TCP = "TCP's own checksum keeps it from the driver"

# How often a case is tried in real time before it counts as failed.
REAL_TIME_TRIES = 3

Verdict = Literal["pass", "FAIL", "-"]


@dataclass(frozen=True)
class Result:
    """One line of the report. "-": cannot be tried on this wire, and why."""

    case: str
    wanted: str
    came: str
    verdict: Verdict


@dataclass(frozen=True)
class Subject:
    """What the cases need to know of the driver and the wire that it is tried on."""

    registers: bool
    over_tcp: bool
    checksum: bool
    exact: bool  # virtual time: cases that need thousands of polls run there alone
    error_replies: Mapping[bytes, Quality]

    @property
    def tries(self) -> int:
        """In virtual time nothing is late by chance."""
        return 1 if self.exact else REAL_TIME_TRIES


def run(session: ConformanceSession, subject: Subject) -> list[Result]:
    """Every case in turn; a driver whose fault-free readings are wrong is tried no further."""
    extent = "every channel within 1 % of its range"
    for _ in range(subject.tries):
        fault = session.calibrate()
        if fault is None:
            break
        session.settle()
    if fault is not None:
        return [Result("units and scale", extent, fault, "FAIL")]
    off = ", ".join(sorted({f"{tolerance / 2:.2g}" for tolerance in session.tolerance.values()}))
    results = [Result("units and scale", extent, f"largest differences {off}", "pass")]
    results += [tried(case, session, subject) for case in CASES]
    return results


def tried(case: Case, session: ConformanceSession, subject: Subject) -> Result:
    """In real time a case that fails is tried again: a busy computer is late by chance, a wrong driver wrong always."""
    late: list[str] = []
    for _ in range(subject.tries):
        result = case(session, subject)
        if result.verdict != "FAIL":
            break
        late.append(result.came)
        session.settle()
        session.recover()
    if late and result.verdict != "FAIL":
        return replace(result, came=f"{result.came}; at try {len(late) + 1}, after: {late[0]}")
    return result


def _try(
    session: ConformanceSession, case: str, wanted: frozenset[Quality], tries: Sequence[Sequence[Fault]]
) -> Result:
    """Each of `tries` (faults for one poll's replies), then back to good."""
    came: set[str] = set()
    complaints: list[str] = []
    slowest = 0
    for afflictions in tries:
        poll = session.poll(afflictions)
        came |= {str(quality) for quality in poll.qualities}
        recovering, good = session.recover()
        slowest = max(slowest, recovering)
        complaints += [f"{afflictions[0].name}: {text}" for text in _complaints(poll, wanted)]
        complaints += [f"after {afflictions[0].name}: {text}" for text in _complaints(good, GOOD)]
    text = ", ".join(sorted(came)) + f"; right again after {slowest} poll{'s' * (slowest != 1)}"
    return _result(case, wanted, text, complaints)


def _result(case: str, wanted: frozenset[Quality], came: str, complaints: Sequence[str]) -> Result:
    required = " | ".join(str(quality) for quality in Quality if quality in wanted)
    if complaints:
        more = f" (and {len(complaints) - 1} more)" if len(complaints) > 1 else ""
        return Result(case, required, complaints[0] + more, "FAIL")
    return Result(case, required, came, "pass")


def _complaints(poll: Poll, wanted: frozenset[Quality]) -> list[str]:
    unwanted = poll.qualities - wanted
    return [*poll.wrong, *([str(poll)] if unwanted and not poll.wrong else [])]


def _always(fault: Fault) -> Sequence[Fault]:
    """To every reply of one poll; no driver makes more exchanges than this in one."""
    return [fault] * 64


def _each(*found: Fault) -> list[Sequence[Fault]]:
    return [_always(fault) for fault in found]


def _ends_of_range(session: ConformanceSession, _: Subject) -> Result:
    complaints = []
    for end in (0, 1):
        session.truth.go_to(end)
        complaints += _complaints(session.poll(turn=False), GOOD)
    return _result("range: lowest and highest value", GOOD, "ok", complaints)


def _sensor_off(session: ConformanceSession, _: Subject) -> Result:
    """Each sensor off in turn: it must have no number, the others none that is wrong."""
    came: set[str] = set()
    complaints = []
    for place, channel in enumerate(session.gauge.channels):
        session.truth.turn()
        session.truth.values[channel.name] = math.nan
        poll = session.poll(turn=False)
        quality = poll.readings[place].quality
        came.add(str(quality))
        complaints += [f"{channel.name} off: {text}" for text in poll.wrong]
        if quality not in NO_VALUE | NO_ANSWER:
            complaints.append(f"{channel.name} off: {poll}")
    complaints += _complaints(session.recover()[1], GOOD)
    return _result("a sensor is off", NO_VALUE, ", ".join(sorted(came)), complaints)


def _time_stamp(session: ConformanceSession, _: Subject) -> Result:
    """The harness checks every stamp of every poll; here the reply takes long to come."""
    return _try(session, "time stamp: when asked, not when answered", GOOD, _each(faults.late(0.5)))


def _no_reply(session: ConformanceSession, _: Subject) -> Result:
    return _try(session, "no reply", NO_ANSWER, _each(faults.SILENT))


def _garbage_before(session: ConformanceSession, _: Subject) -> Result:
    found = _each(*(faults.garbage_before(junk) for junk in (faults.GARBAGE, b"\xff", b"\r\n")))
    return _try(session, "garbage before the reply", DAMAGED | GOOD | NO_ANSWER, found)


def _garbage_inside(session: ConformanceSession, subject: Subject) -> Result:
    case = "garbage inside the reply"
    if subject.registers and subject.over_tcp:
        return Result(case, "", BY_TCP, "-")
    found = _each(*(faults.garbage_inside(share) for share in (0.1, 0.5, 0.9)))
    return _try(session, case, DAMAGED | NO_ANSWER, found)


def _garbage_after(session: ConformanceSession, _: Subject) -> Result:
    return _try(session, "garbage after the reply", DAMAGED | GOOD, _each(faults.garbage_after()))


def _late(session: ConformanceSession, _: Subject) -> Result:
    return _try(session, "late: after the timeout", NO_ANSWER, [[faults.late(1.5)], [faults.late(3.5)]])


def _later(session: ConformanceSession, subject: Subject) -> Result:
    """So late that it comes while the next request waits for its own reply, which takes its time, too.

    A timeout, the drain after it and the rest are over by then: a device can hardly be later.
    """
    case = "late: into the next request"
    if not subject.exact:
        return Result(case, "", "in virtual time", "-")
    wanted = NO_ANSWER | DAMAGED | GOOD
    complaints = []
    came: set[str] = set()
    for timeouts in (2 + REST_TIMEOUTS + share for share in (0.3, 0.6)):
        for delay in (timeouts, 0.9):
            poll = session.poll([faults.late(delay)])
            came |= {str(quality) for quality in poll.qualities}
            complaints += [f"late by {timeouts} timeouts: {text}" for text in _complaints(poll, wanted)]
        session.settle()
        complaints += _complaints(session.recover()[1], GOOD)
    if complaints and not subject.registers:
        return Result(case, "", f"not detectable on this wire, {complaints[0]}", "-")
    return _result(case, wanted, ", ".join(sorted(came)), complaints)


def _split(session: ConformanceSession, _: Subject) -> Result:
    return _try(session, "split in two", GOOD, _each(faults.split(0.2), faults.split(0.5), faults.split(0.95)))


def _doubled(session: ConformanceSession, _: Subject) -> Result:
    return _try(session, "doubled", DAMAGED | GOOD, _each(faults.doubled()))


def _cut(session: ConformanceSession, _: Subject) -> Result:
    found = _each(*(faults.cut(share) for share in (0.0, 0.4, 0.8)))
    return _try(session, "cut", DAMAGED | NO_ANSWER, found)


def _bit_flips(session: ConformanceSession, subject: Subject) -> Result:
    """Every single bit of a reply turned, one at a time."""
    case = "one bit turned"
    if subject.over_tcp:
        return Result(case, "", BY_TCP, "-")
    if not subject.exact:
        return Result(case, "", "every bit: in virtual time", "-")
    bits = 8 * session.wire.peer.longest
    wrong = []
    for bit in range(bits):
        poll = session.poll([faults.flipped(bit)])
        wrong += [f"bit {bit}: {text}" for text in poll.wrong[:1]]
        wrong += [f"after bit {bit}: {text}" for text in _complaints(session.recover()[1], GOOD)]
    after = [text for text in wrong if text.startswith("after")]
    if wrong and not after and not subject.checksum:
        text = f"{len(wrong)} of {bits} give another number: not detectable on this wire, set a parity"
        return Result(case, "no wrong number, with a checksum", text, "-")
    return _result(case, DAMAGED | NO_ANSWER | GOOD, f"{bits} bits, no wrong number", after or wrong)


def _forged(session: ConformanceSession, subject: Subject) -> Result:
    case = "wrong unit, function, length"
    if not subject.registers:
        foreign = faults.replaced(b"\x01\x84\x02\xc2\xc1\r\n")
        return _try(session, "another device's reply", DAMAGED | NO_ANSWER, _each(foreign))
    kinds: list[faults.Forgery] = ["unit", "function", "length"]
    if subject.over_tcp:
        kinds.append("transaction")
    found = _each(*(faults.forged(kind, subject.over_tcp) for kind in kinds))
    return _try(session, case, DAMAGED | (NO_ANSWER if subject.over_tcp else frozenset()), found)


def _errors(session: ConformanceSession, subject: Subject) -> Result:
    case = "error replies"
    if subject.registers:
        found = _each(*(faults.refused(code, subject.over_tcp) for code in EXCEPTIONS))
        return _try(session, case, frozenset({Quality.DEVICE_ERROR}), found)
    if not subject.error_replies:
        return Result(case, "", "the simulated device names none in `error_replies`", "-")
    results = [
        _try(session, case, frozenset({quality}), _each(faults.replaced(reply)))
        for reply, quality in subject.error_replies.items()
    ]
    return next((result for result in results if result.verdict != "pass"), results[-1])


def _unplugged(session: ConformanceSession, _: Subject) -> Result:
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


Case = Callable[[ConformanceSession, Subject], Result]
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


def slowest_line(session: ConformanceSession, baud: int) -> Result:
    """A wire at its lowest speed: replies take long and are whole."""
    polls = list(itertools.islice(iter(session.poll, None), 2))
    return _result(f"the line at {baud} baud", GOOD, "ok", [text for poll in polls for text in _complaints(poll, GOOD)])
