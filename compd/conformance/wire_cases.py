"""Faults of the wire: late, cut, doubled, garbled, silent, unplugged. No number may ever be wrong."""

from __future__ import annotations

from random import Random

from compd.conformance import faults
from compd.conformance.case_result import (
    BY_TCP,
    DAMAGED,
    GOOD,
    IN_VIRTUAL_TIME,
    NO_ANSWER,
    NO_NUMBER,
    Case,
    CaseResult,
    Subject,
    every_reply,
    faulty_polls,
    one_poll_each,
    result_of,
    violations_of,
)
from compd.conformance.harness import ASKED_AGAIN_TIMEOUTS, ConformanceSession
from compd.gauge import Quality

ENDS_OF_MAPS = (2, 3, 4)  # those of them that slaves send beyond their last register

IN_A_ROW = 5  # more than any driver counts before it acts
IN_ANY_ORDER = 300


def _time_stamp(session: ConformanceSession, _: Subject) -> CaseResult:
    """The harness checks every stamp of every poll; here the reply takes long to come."""
    return faulty_polls(session, "time stamp: when asked, not when answered", GOOD, one_poll_each(faults.late(0.15)))


def _no_reply(session: ConformanceSession, _: Subject) -> CaseResult:
    return faulty_polls(session, "no reply", NO_ANSWER, one_poll_each(faults.SILENT))


def _garbage_before(session: ConformanceSession, _: Subject) -> CaseResult:
    tries = one_poll_each(*(faults.garbage_before(junk) for junk in (faults.GARBAGE, b"\xff", b"\r\n")))
    return faulty_polls(session, "garbage before the reply", DAMAGED | GOOD | NO_ANSWER, tries)


def _garbage_inside(session: ConformanceSession, subject: Subject) -> CaseResult:
    case = "garbage inside the reply"
    if subject.registers and subject.over_tcp:
        return CaseResult(case, "", BY_TCP, "-")
    tries = one_poll_each(*(faults.garbage_inside(share) for share in (0.1, 0.5, 0.9)))
    return faulty_polls(session, case, DAMAGED | NO_ANSWER, tries)


def _garbage_after(session: ConformanceSession, _: Subject) -> CaseResult:
    return faulty_polls(session, "garbage after the reply", DAMAGED | GOOD, one_poll_each(faults.garbage_after()))


def _late(session: ConformanceSession, _: Subject) -> CaseResult:
    return faulty_polls(session, "late: after the timeout", NO_ANSWER, [[faults.late(1.5)], [faults.late(3.5)]])


def _later(session: ConformanceSession, subject: Subject) -> CaseResult:
    """Late enough to arrive while the next request waits for its own, slow reply.

    A timeout, the drain after it and the rest are over by then: a device can hardly be later.
    """
    case = "late: into the next request"
    if not subject.exact:
        return CaseResult(case, "", IN_VIRTUAL_TIME, "-")
    allowed = NO_ANSWER | DAMAGED | GOOD
    violations = []
    observed: set[str] = set()
    for timeouts in (ASKED_AGAIN_TIMEOUTS + share for share in (0.3, 0.6)):
        for delay in (timeouts, 0.9):
            poll = session.poll([faults.late(delay)])
            observed |= {str(quality) for quality in poll.qualities}
            violations += [f"late by {timeouts} timeouts: {text}" for text in violations_of(poll, allowed)]
        session.settle()
        violations += violations_of(session.recover()[1], GOOD)
    if violations and not subject.registers:
        return CaseResult(case, "", f"not detectable on this wire, {violations[0]}", "-")
    return result_of(case, allowed, ", ".join(sorted(observed)), violations)


def _split(session: ConformanceSession, _: Subject) -> CaseResult:
    return faulty_polls(
        session, "split in two", GOOD, one_poll_each(faults.split(0.2), faults.split(0.5), faults.split(0.95))
    )


def _doubled(session: ConformanceSession, _: Subject) -> CaseResult:
    return faulty_polls(session, "doubled", DAMAGED | GOOD, one_poll_each(faults.doubled()))


def _cut(session: ConformanceSession, _: Subject) -> CaseResult:
    tries = one_poll_each(*(faults.cut(share) for share in (0.0, 0.4, 0.8)))
    return faulty_polls(session, "cut", DAMAGED | NO_ANSWER, tries)


def _end_of_map(session: ConformanceSession, _: Subject) -> CaseResult:
    """A slave whose registers end at the last one read: the line asks beyond it, and must learn that."""
    violations = []
    for beyond in (faults.SILENT, *(faults.refused(code, over_tcp=False) for code in ENDS_OF_MAPS)):
        session.reopen()
        session.wire.peer.end_map(beyond)
        polls = [session.poll()]
        learning = 2 * session.wire.peer.blocks + 1
        polls += [session.poll() for _ in range(learning)]
        violations += [f"{beyond.name}: {text}" for poll in polls for text in poll.wrong]
        last = [session.poll() for _ in range(learning)]
        violations += [f"{beyond.name}, still: {text}" for poll in last for text in violations_of(poll, GOOD)]
    session.wire.peer.end_map(None)
    session.reopen()
    return result_of("the map ends: silent, exceptions 2, 3, 4", GOOD, "ok, once the line knows", violations)


def _unplugged(session: ConformanceSession, _: Subject) -> CaseResult:
    session.poll()
    session.wire.unplug()
    polls = [session.poll(), session.poll()]
    session.wire.replug()
    count, good = session.recover()
    lost = frozenset({Quality.LINE_LOST})
    violations = [text for poll in polls for text in violations_of(poll, lost | NO_ANSWER)]
    if Quality.LINE_LOST not in polls[1].qualities:
        violations.append(f"still {polls[1]} at the second poll")
    violations += [f"replugged: {text}" for text in violations_of(good, GOOD)]
    return result_of(
        "unplugged, replugged", lost, f"line_lost; right again after {count} poll{'s' * (count != 1)}", violations
    )


def slowest_line(session: ConformanceSession, baud: int) -> CaseResult:
    """A wire at its lowest speed: replies take long and are whole."""
    violations = [text for poll in (session.poll(), session.poll()) for text in violations_of(poll, GOOD)]
    return result_of(f"the line at {baud} baud", GOOD, "ok", violations)


def _many_faults(session: ConformanceSession, subject: Subject) -> CaseResult:
    """The same fault several times, then all kinds in any order; a good poll is right in between."""
    case = "faults in a row, and in any order"
    if not subject.exact:
        return CaseResult(case, "", IN_VIRTUAL_TIME, "-")
    kinds = subject.possible(
        (faults.SILENT, faults.cut(0.5), faults.garbage_before(), faults.garbage_inside(), faults.late(1.5))
    )
    mixed = [*kinds, faults.NONE, *subject.possible([faults.doubled()]), faults.split(0.5)]
    violations = []
    for fault in kinds:
        for number in range(IN_A_ROW):
            texts = violations_of(session.poll(every_reply(fault)), NO_NUMBER | GOOD)
            violations += [f"{fault.name}, for the {number + 1}. time: {text}" for text in texts]
        violations += violations_of(session.recover()[1], GOOD)
    random = Random(0)
    for _ in range(IN_ANY_ORDER):
        chosen = [random.choice(mixed) for _ in range(2)]
        texts = violations_of(session.poll(chosen), NO_NUMBER | GOOD)
        violations += [f"{' and '.join(fault.name for fault in chosen)}: {text}" for text in texts]
    session.settle()
    violations += violations_of(session.recover()[1], GOOD)
    return result_of(case, NO_NUMBER | GOOD, f"{len(kinds) * IN_A_ROW + IN_ANY_ORDER} of them", violations)


WIRE_CASES: tuple[Case, ...] = (
    _no_reply,
    _garbage_before,
    _garbage_inside,
    _garbage_after,
    _split,
    _cut,
    _many_faults,
    _unplugged,
)
CASES_OF_ANSWERS: tuple[Case, ...] = (_time_stamp, _late, _later, _doubled)
CASES_ON_RTU: tuple[Case, ...] = (_end_of_map,)
