"""All cases in their order: events on the wire, the required and the observed quality."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from compd.conformance import waiting_cases, wire_cases
from compd.conformance.case_result import Case, CaseResult, Subject
from compd.conformance.damage_cases import DAMAGE_CASES
from compd.conformance.harness import ConformanceSession
from compd.conformance.reply_cases import REPLY_CASES
from compd.conformance.value_cases import VALUE_CASES
from compd.conformance.waiting_cases import waits, waits_after_faults
from compd.conformance.wire_cases import CASES_ON_RTU, WIRE_CASES

CASES: tuple[Case, ...] = (*VALUE_CASES, *WIRE_CASES, *DAMAGE_CASES, *REPLY_CASES)
# Cases of polled devices: late answers and repeated requests.
CASES_OF_ANSWERS: tuple[Case, ...] = (*waiting_cases.CASES_OF_ANSWERS, *wire_cases.CASES_OF_ANSWERS)
# Cases whose failure ends the test: each further poll would be slow or wrong.
FIRST_CASES = ("waits", "units and scale", "waits after faults")


def run_cases(session: ConformanceSession, subject: Subject) -> Iterator[CaseResult]:
    """Every case in turn, until one of the first fails."""
    for first in (waits, _units_and_scale, waits_after_faults):
        result = first(session, subject)
        yield result
        if result.verdict == "FAIL":
            return
    cases = [*(() if subject.unsolicited else CASES_OF_ANSWERS), *CASES]
    cases += CASES_ON_RTU if subject.registers and not subject.over_tcp else ()
    for case in cases:
        yield run_case(case, session, subject)


def _units_and_scale(session: ConformanceSession, subject: Subject) -> CaseResult:
    case, required = "units and scale", "every channel within one digit of the device"
    for _ in range(subject.tries):
        fault = session.calibrate()
        if fault is None:
            break
        session.settle()
    if fault is not None:
        return CaseResult(case, required, fault, "FAIL")
    digits = ", ".join(f"{c.name} {session.replies.digit[c.name]:.2g} {c.unit}" for c in session.gauge.channels)
    return CaseResult(case, required, f"one digit is {digits}", "pass")


def run_case(case: Case, session: ConformanceSession, subject: Subject) -> CaseResult:
    """Repeat a case that fails in real time: a busy computer is late by chance, a faulty driver fails always."""
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
