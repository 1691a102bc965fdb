"""All cases, in their order: what happens on the wire, the quality that must come, and the one that came."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from compd.commissioning.conformance.case_result import Case, CaseResult, Subject
from compd.commissioning.conformance.harness import ConformanceSession
from compd.commissioning.conformance.reply_cases import REPLY_CASES
from compd.commissioning.conformance.value_cases import VALUE_CASES
from compd.commissioning.conformance.waiting_cases import waits
from compd.commissioning.conformance.wire_cases import CASES_ON_RTU, WIRE_CASES

FIRST_OF_ALL = ("waits, retries", "units and scale")  # a driver that fails in them is tried no further
CASES: tuple[Case, ...] = (*VALUE_CASES, *WIRE_CASES, *REPLY_CASES)


def run_cases(session: ConformanceSession, subject: Subject) -> Iterator[CaseResult]:
    """Every case in turn; a driver that waits by itself, or whose fault-free readings are wrong, is tried no further."""
    waiting = waits(session, subject)
    yield waiting
    if waiting.verdict == "FAIL":
        return
    required = "every channel within one digit of the device"
    for _ in range(subject.tries):
        fault = session.calibrate()
        if fault is None:
            break
        session.settle()
    if fault is not None:
        yield CaseResult(FIRST_OF_ALL[1], required, fault, "FAIL")
        return
    digits = ", ".join(
        f"{channel.name} {session.replies.digit[channel.name]:.2g} {channel.unit}"
        for channel in session.gauge.channels
    )
    yield CaseResult(FIRST_OF_ALL[1], required, f"one digit is {digits}", "pass")
    cases = [*CASES, *(CASES_ON_RTU if subject.registers and not subject.over_tcp else ())]
    for case in cases:
        yield run_case(case, session, subject)


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
