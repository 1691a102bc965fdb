"""Waits of a driver: for its replies only, by the line's clock; and one request at a time."""

from __future__ import annotations

import resource
import time

from compd.conformance import faults
from compd.conformance.case_result import (
    IN_VIRTUAL_TIME,
    Case,
    CaseResult,
    Subject,
    every_reply,
)
from compd.conformance.clock_calls import clock_calls
from compd.conformance.harness import ConformanceSession
from compd.conformance.virtual import GAP_S, TURNAROUND_S

LOOKS = 5
MAX_BLOCK_S = 0.05  # by the computer's clock, in each of LOOKS polls; above the share of other threads
IDLE_TIMEOUTS = 0.5  # in line timeouts: wait in a poll with immediate replies
EXCHANGE_S = GAP_S + TURNAROUND_S  # duration of an exchange on a virtual line
MAX_WAIT_S = 10.0  # longest wait for a missing reply
FAULTS = (
    faults.SILENT, faults.cut(0.5), faults.garbage_before(), faults.garbage_inside(), faults.late(1.5),
    faults.replaced(b"ERR\r\n"),
)  # fmt: skip


def waits(session: ConformanceSession, subject: Subject) -> CaseResult:
    """The first case, without faults: a driver with waits of its own would take too long in the others."""
    case, required = "waits", "for its replies alone, by the line's clock"
    if not subject.exact:
        return CaseResult(case, "", IN_VIRTUAL_TIME, "-")
    blocked_s = []
    for _ in range(LOOKS):
        started_s, gave_up = time.perf_counter(), resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw
        with clock_calls() as called:
            poll = session.poll()
        # a waiting thread yields the processor; a preempted one does not
        waited = resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw > gave_up
        blocked_s.append(time.perf_counter() - started_s if waited else 0.0)
        if called:
            return CaseResult(case, required, f"`read` calls {called[0]}", "FAIL")
        pauses_s = sum(exchange.pause_s for exchange in session.exchanges)
        idle_s = poll.duration_s - pauses_s - EXCHANGE_S * max(1, len(session.exchanges))
        if poll.ok and idle_s > IDLE_TIMEOUTS * session.wire.timeout_s:
            text = f"a poll takes {poll.duration_s:.3g} s although its replies come at once: it waits {idle_s:.3g} s"
            return CaseResult(case, required, text, "FAIL")
    if min(blocked_s) > MAX_BLOCK_S:
        text = f"`read` stands still for {min(blocked_s):.3g} s while the line does not wait"
        return CaseResult(case, required, text, "FAIL")
    return CaseResult(case, required, f"{poll.duration_s:.3g} s on the line's clock", "pass")


def waits_after_faults(session: ConformanceSession, subject: Subject) -> CaseResult:
    """The same with missing or damaged replies."""
    case, required = "waits after faults", "for its replies alone, by the line's clock"
    if not subject.exact:
        return CaseResult(case, "", IN_VIRTUAL_TIME, "-")
    longest_s = 0.0
    for fault in subject.possible(FAULTS):
        with clock_calls() as called:
            poll = session.poll(every_reply(fault))
        if called:
            return CaseResult(case, required, f"{fault.name}: `read` calls {called[0]}", "FAIL")
        longest_s = max(longest_s, poll.duration_s)
        session.settle()
        session.recover()
    if longest_s > MAX_WAIT_S:
        return CaseResult(case, required, f"waits {longest_s:.3g} s longest wait for a missing reply", "FAIL")
    return CaseResult(case, required, f"at most {longest_s:.3g} s on the line's clock", "pass")


def _retries(session: ConformanceSession, subject: Subject) -> CaseResult:
    """A failing poll has no more requests than a good one."""
    case, required = "no request twice", "as many requests as without a fault, or fewer"
    if not subject.exact:
        return CaseResult(case, "", IN_VIRTUAL_TIME, "-")
    for fault in FAULTS:
        session.poll(every_reply(fault))
        requests = len(session.exchanges)
        session.settle()
        session.recover()
        if requests > session.most_requests:
            text = f"asks {requests} times in one poll, {session.most_requests} without a fault"
            observed = f"{fault.name}: {text}: the line's thread asks again, not the driver"
            return CaseResult(case, required, observed, "FAIL")
    return CaseResult(case, required, f"{session.most_requests} in a poll", "pass")


CASES_OF_ANSWERS: tuple[Case, ...] = (_retries,)
