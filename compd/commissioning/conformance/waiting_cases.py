"""What a driver waits for: the line's clock alone, no longer than its exchange takes, and no request twice."""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from compd.commissioning.conformance import faults
from compd.commissioning.conformance.case_result import (
    IN_VIRTUAL_TIME,
    CaseResult,
    Subject,
    every_reply,
)
from compd.commissioning.conformance.harness import ConformanceSession
from compd.commissioning.conformance.virtual import GAP_S, TURNAROUND_S

LOOKS = 5
LONGEST_BLOCK_S = 5e-3  # by the computer's clock, in each of LOOKS polls
IDLE_TIMEOUTS = 0.5  # in line timeouts: waiting in a poll whose replies come at once
EXCHANGE_S = GAP_S + TURNAROUND_S  # of a virtual line
LONGEST_WAIT_S = 10.0  # for a reply that does not come
CLOCK_FUNCTIONS = (
    "sleep", "time", "time_ns", "monotonic", "monotonic_ns", "perf_counter", "perf_counter_ns", "process_time",
)  # fmt: skip
FAULTS = (
    faults.SILENT, faults.cut(0.5), faults.garbage_before(), faults.garbage_inside(), faults.late(1.5),
    faults.replaced(b"ERR\r\n"),
)  # fmt: skip


def waits(session: ConformanceSession, subject: Subject) -> CaseResult:
    """First of all cases: a driver that waits by itself would take for ever in the others."""
    case, required = "waits, retries", "the line's clock alone; no request twice"
    if not subject.exact:
        return CaseResult(case, "", IN_VIRTUAL_TIME, "-")
    complaint = _without_faults(session) or _with_faults(session)
    if complaint:
        return CaseResult(case, required, complaint, "FAIL")
    return CaseResult(case, required, f"{session.most_requests or 1} requests in a poll", "pass")


def _without_faults(session: ConformanceSession) -> str:
    """What is wrong with the waiting of polls whose replies come at once; "" if nothing is."""
    blocked_s = []
    for _ in range(LOOKS):
        started_s, gave_up = time.perf_counter(), resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw
        with _calls_watched() as called:
            poll = session.poll()
        # a thread that waits gives the processor up; one from which it is taken has no part in that
        waited = resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw > gave_up
        blocked_s.append(time.perf_counter() - started_s if waited else 0.0)
        if called:
            return f"`read` calls {called[0]}: waiting and time are the line's"
        idle_s = poll.duration_s - EXCHANGE_S * max(1, len(session.exchanges))
        if idle_s > IDLE_TIMEOUTS * session.wire.timeout_s:
            return f"a poll takes {poll.duration_s:.3g} s although its replies come at once: it waits {idle_s:.3g} s"
    if min(blocked_s) > LONGEST_BLOCK_S:
        return f"`read` stands still for {min(blocked_s):.3g} s, without any line: it waits for something else"
    return ""


def _with_faults(session: ConformanceSession) -> str:
    """The same where replies do not come, or are damaged; and requests that are sent again."""
    for fault in FAULTS:
        with _calls_watched() as called:
            poll = session.poll(every_reply(fault))
        requests = len(session.exchanges)
        if called:
            return f"{fault.name}: `read` calls {called[0]}: waiting and time are the line's"
        if requests > max(1, session.most_requests):
            text = f"asks {requests} times in one poll, {session.most_requests} without a fault"
            return f"{fault.name}: {text}: the line's thread asks again, not the driver"
        if poll.duration_s > LONGEST_WAIT_S:
            return f"{fault.name}: waits {poll.duration_s:.3g} s, longer than any line"
        session.recover()
    return ""


@contextmanager
def _calls_watched() -> Iterator[list[str]]:
    """The clock functions of the computer that are called meanwhile, by their names."""
    called: list[str] = []
    watched: dict[Callable[..., Any], str] = {getattr(time, name): f"time.{name}" for name in CLOCK_FUNCTIONS}

    def note(frame: FrameType, event: str, function: Any) -> None:
        if event != "c_call":
            return
        name = watched.get(function) if callable(function) and function.__hash__ else None
        if name is None and getattr(function, "__qualname__", "") in ("datetime.now", "datetime.utcnow"):
            name = function.__qualname__
        if name is not None:
            called.append(name)

    if sys.getprofile() is not None:  # a profiler is at work, and there can be one alone
        yield called
        return
    sys.setprofile(note)
    try:
        yield called
    finally:
        sys.setprofile(None)
