"""Result of a case: required and observed qualities, and whether the driver passes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from compd.conformance.faults import Fault
from compd.conformance.harness import ConformanceSession, Poll
from compd.gauge import Quality

# Allowed qualities of a damaged reply. OK is allowed, with the right value, if the driver finds the whole reply in the
# damage.
DAMAGED = frozenset({Quality.MISMATCH, Quality.CRC, Quality.INCOMPLETE})
NO_ANSWER = frozenset({Quality.TIMEOUT, Quality.SILENT})
NO_VALUE = frozenset(
    {Quality.SENSOR_FAULT, Quality.OVER_RANGE, Quality.UNDER_RANGE, Quality.NOT_FINITE, Quality.DEVICE_ERROR}
)
GOOD = frozenset({Quality.OK})
NO_NUMBER = DAMAGED | NO_ANSWER | NO_VALUE

BY_TCP = "TCP's own checksum keeps it from the driver"
IN_VIRTUAL_TIME = "in virtual time"
MAX_EXCHANGES = 64  # most exchanges of a driver in one poll
REAL_TIME_TRIES = 3

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
    """The properties of driver and wire on which the cases depend.

    registers : a Modbus driver, else one on a line of bytes.
    over_tcp : TCP's own checksum keeps damage from the driver.
    checksum : the protocol has one of its own.
    exact : in virtual time; cases that need thousands of polls run there alone.
    error_replies : whole replies by which the device reports an error, and the quality that must come.
    unsolicited : the device speaks by itself.
    options : those that the driver is tried with.
    another : the driver once more, with other options and a simulated device of its own, on a virtual wire.
    """

    registers: bool
    over_tcp: bool
    checksum: bool
    exact: bool
    error_replies: Mapping[bytes, Quality]
    unsolicited: bool = False
    options: Any = None
    another: Callable[[Any], ConformanceSession] | None = field(default=None, repr=False)

    @property
    def tries(self) -> int:
        """Tries of a case before it counts as failed; one in virtual time, which has no random delays."""
        return 1 if self.exact else REAL_TIME_TRIES

    def possible(self, kinds: Iterable[Fault]) -> Sequence[Fault]:
        """The faults that this device's replies can have."""
        return [fault for fault in kinds if not (self.unsolicited and fault.only_of_answers)]


Case = Callable[[ConformanceSession, Subject], CaseResult]


def result_of(
    case: str,
    allowed: frozenset[Quality],
    observed: str,
    violations: Sequence[str],
    undetectable: Sequence[str] = (),
) -> CaseResult:
    """FAIL with the first violation; "-" for a fault that no driver could detect."""
    required = " | ".join(str(quality) for quality in Quality if quality in allowed)
    if violations:
        more = f" (and {len(violations) - 1} more)" if len(violations) > 1 else ""
        return CaseResult(case, required, violations[0] + more, "FAIL")
    if undetectable:
        more = f" (and {len(undetectable) - 1} more)" if len(undetectable) > 1 else ""
        return CaseResult(case, required, f"not detectable on this wire: {undetectable[0]}{more}", "-")
    return CaseResult(case, required, observed, "pass")


def violations_of(poll: Poll, allowed: frozenset[Quality]) -> list[str]:
    """Violations of a poll: numbers, or a quality that is not allowed."""
    unwanted = poll.qualities - allowed
    return [*poll.wrong, *([str(poll)] if unwanted and not poll.wrong else [])]


def every_reply(fault: Fault) -> Sequence[Fault]:
    """The fault for each of the replies of one poll."""
    return [fault] * MAX_EXCHANGES


def one_poll_each(*tried_faults: Fault) -> list[Sequence[Fault]]:
    """One poll under each fault."""
    return [every_reply(fault) for fault in tried_faults]


def faulty_polls(
    session: ConformanceSession,
    case: str,
    allowed: frozenset[Quality],
    tries: Iterable[Sequence[Fault]],
) -> CaseResult:
    """One poll under each of `tries` (the faults of its replies), each followed by polls until all is good again."""
    qualities: set[str] = set()
    violations: list[str] = []
    undetectable: list[str] = []
    slowest = 0
    for reply_faults in tries:
        name = next(fault.name for fault in reply_faults if fault.name != "none")
        poll = session.poll(reply_faults)
        delivered = ", ".join(repr(exchange.delivered) for exchange in session.exchanges)
        qualities |= {str(quality) for quality in poll.qualities}
        violations += [f"{name}: {text}: {delivered}" for text in violations_of(poll, allowed)]
        undetectable += [f"{name}: {text}: {delivered}" for text in poll.undetectable]
        recovering, good = session.recover()
        slowest = max(slowest, recovering)
        violations += [f"after {name}: {text}" for text in violations_of(good, GOOD)]
    text = ", ".join(sorted(qualities)) + f"; right again after {slowest} poll{'s' * (slowest != 1)}"
    return result_of(case, allowed, text, violations, undetectable)
