"""A driver under test, found by its name, and all its cases on all its wires."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from compd.conformance import waiting_cases, wire_cases
from compd.conformance.case_result import GOOD, Case, CaseResult, Subject, result_of, violations_of
from compd.conformance.damage_cases import DAMAGE_CASES
from compd.conformance.harness import ConformanceSession, ConformanceWire
from compd.conformance.peer import GOLDEN, Peer, SensorValues
from compd.conformance.reply_cases import REPLY_CASES
from compd.conformance.value_cases import VALUE_CASES
from compd.conformance.virtual import VirtualWire
from compd.conformance.waiting_cases import waits, waits_after_faults
from compd.conformance.wire import CHARACTER_BITS, RealWire
from compd.conformance.wire_cases import CASES_ON_RTU, WIRE_CASES, slowest_line
from compd.errors import PluginError, Problem
from compd.gauge import Gauge, Quality
from compd.lines import PolledDefinition, kinds_that_carry, polled_kind
from compd.plugins import GAUGES, SIMULATED_GAUGES, load
from compd.pushed_gauge import PushedGauge

PLACES = 40  # positions in a line and the pause behind it at which the line is opened
CHARACTER_S = 10 / 9600  # makes a line about as long as the pause behind it
PERIODS_APART = (3, 10, 100)  # periods from one poll to the next
RESTS_BEFORE_A_PLACE = 3  # periods after which lines have the sensors' present values


def opened_within_a_line(session: ConformanceSession, wire: VirtualWire) -> CaseResult:
    """The line is opened at any position of the device's output."""
    violations = []
    session.recover()
    for index in range(PLACES):
        period_s = wire.pause_s + wire.peer.longest * wire.character_s
        session.reopen()
        session.sensors.advance()
        wire.rest((RESTS_BEFORE_A_PLACE + index * GOLDEN % 1.0) * period_s)
        violations += violations_of(session.poll(new_values=False), GOOD)
    return result_of("opened within a line", GOOD, f"ok, at {PLACES} places", violations)


def seldom_read(session: ConformanceSession, wire: VirtualWire) -> CaseResult:
    """Polled seldom: waiting lines are old."""
    violations = []
    session.recover()
    for periods in PERIODS_APART:
        wire.rest((periods + 0.5) * wire.pause_s)
        texts = violations_of(session.poll(), GOOD)
        violations += [f"{periods} lines later: {text}" for text in texts]
    return result_of("polled seldom: the newest line", GOOD, "ok", violations)


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


MIN_BAUD = 1200  # slowest rate of all devices in the shipped table
SLOW_TIMEOUT_S = 0.3


@dataclass(frozen=True)
class DriverUnderTest:
    """A driver with its simulated device and the options of the test."""

    name: str
    gauge: type[Gauge[Any]]
    simulator: Any
    options: Any

    @property
    def registers(self) -> bool:
        return self.gauge.line_kind == "registers"

    @property
    def error_replies(self) -> Mapping[bytes, Quality]:
        """Whole error replies of the device by its simulator, with the quality of each."""
        device = self.simulator(self.options, lambda channel: math.nan)
        replies = getattr(device, "error_replies", {})
        return {reply: Quality(quality) for reply, quality in replies.items()}

    @property
    def by_dtr(self) -> bool:
        """Whether its device is triggered by DTR."""
        return "DTR" in self.gauge(self.options).serial_signals

    @property
    def unsolicited(self) -> bool:
        """Whether its device sends unsolicited readings."""
        device = self.simulator(self.options, lambda channel: 0.0)
        return not self.registers and not self.by_dtr and bool(device.speak())

    def kinds(self) -> list[str]:
        """The kinds of line of this computer on which it can be tried."""
        if self.by_dtr or self.unsolicited:
            return []
        carrying = kinds_that_carry(self.gauge.line_kind)
        return [kind.kind for kind in carrying if isinstance(kind, PolledDefinition) and kind.tries_drivers]

    def subject(self, over_tcp: bool, exact: bool) -> Subject:
        checksum = self.registers or self.gauge.integrity == "checksum"
        errors = self.error_replies
        return Subject(
            self.registers, over_tcp, checksum, exact, errors, self.unsolicited, self.options, self._with_options
        )

    def peer(self, over_tcp: bool = False) -> tuple[Peer, SensorValues]:
        """The simulated device at the far end, with the values of its sensors. `over_tcp`: Modbus in TCP framing."""
        sensors = SensorValues(self.gauge(self.options).channels, self.gauge.sample_range)
        return Peer(self.simulator, self.options, sensors, over_tcp), sensors

    def virtual(self, character_s: float = 0.0) -> ConformanceSession:
        """The test on a wire in virtual time."""
        return self.virtual_with_wire(character_s)[0]

    def virtual_with_wire(self, character_s: float = 0.0) -> tuple[ConformanceSession, VirtualWire]:
        """The same with the wire, whose time can pass between polls."""
        peer, sensors = self.peer()
        wire = VirtualWire(peer, self.registers, character_s=character_s, unsolicited=self.unsolicited)
        return self._session(wire, sensors), wire

    def real(self, kind: str, directory: Path, **settings: Any) -> ConformanceSession:
        """On a pty or TCP port; `settings`: baud, timeout_s."""
        peer, sensors = self.peer(over_tcp=polled_kind(kind).over_network)
        return self._session(RealWire(peer, kind, directory, **settings), sensors)

    def _with_options(self, options: Any) -> ConformanceSession:
        return replace(self, options=options).virtual()

    def _session(self, wire: ConformanceWire, sensors: SensorValues) -> ConformanceSession:
        return ConformanceSession(self.gauge(self.options), wire, sensors)


def driver_under_test(
    name: str, options: Mapping[str, Any] | None = None, simulator: str | None = None
) -> DriverUnderTest:
    """The driver `name` (entry point, or /file.py:ClassName), ready to be tried.

    `options` : without `driver` and `line`; the driver's own `sample_options` if None.
    `simulator` : the simulated device's entry point or file; `name` if None.
    Raises PluginError when there is no driver, no simulated device, or no options.
    """
    gauge = load(GAUGES, name, f"driver {name}")
    if issubclass(gauge, PushedGauge):
        raise PluginError.of(
            f"driver {name}",
            "its device speaks by itself: there are no requests whose replies could be damaged",
            next_step="try it with `compd gauge read` on a server or broker of yours",
        )
    device = load(SIMULATED_GAUGES, simulator or name, f"simulated device of {name}")
    chosen = (gauge.sample_options if options is None else options) or {}
    try:
        checked = gauge.Options.model_validate({"driver": name, "line": "test", **chosen})
    except ValidationError as error:
        raise PluginError(
            [
                Problem(
                    f"driver {name}, options.{'.'.join(map(str, detail['loc']))}",
                    detail["msg"],
                    next_step="give the driver `sample_options`, or name a file with --options",
                )
                for detail in error.errors(include_url=False)
            ]
        ) from error
    return DriverUnderTest(name, gauge, device, checked)


def run_conformance(driver: DriverUnderTest, on_real_wires: bool = True) -> Iterator[tuple[str, CaseResult]]:
    """Results of every case on every kind of wire, as they arrive: (wire, result).

    First in virtual time, then, with `on_real_wires`, on ptys and TCP ports; once at MIN_BAUD. A driver that fails
    in one of FIRST_CASES is tried no further.
    """
    with tempfile.TemporaryDirectory(prefix="compd-") as temporary:
        for wire, result in _cases_on("virtual time", driver.virtual(), driver.subject(False, True)):
            yield wire, result
            if result.verdict == "FAIL" and result.case in FIRST_CASES:
                return
        slow = driver.virtual(CHARACTER_BITS / MIN_BAUD)
        yield "virtual time", slowest_line(slow, MIN_BAUD)
        if driver.unsolicited:
            yield "virtual time", opened_within_a_line(*driver.virtual_with_wire(CHARACTER_S))
            yield "virtual time", seldom_read(*driver.virtual_with_wire())
        if not on_real_wires:
            return
        if not driver.kinds():
            why = "a pty and TCP have no DTR" if driver.by_dtr else "unsolicited readings are tried in virtual time"
            yield "ptys, ports", CaseResult("on ptys and TCP ports", "", why, "-")
            return
        for kind in driver.kinds():
            session = driver.real(kind, Path(temporary))
            subject = driver.subject(polled_kind(kind).over_network, False)
            yield from _cases_on(kind, session, subject)
        session = driver.real(driver.kinds()[0], Path(temporary), baud=MIN_BAUD, timeout_s=SLOW_TIMEOUT_S)
        try:
            yield driver.kinds()[0], slowest_line(session, MIN_BAUD)
        finally:
            session.close()


def _cases_on(wire: str, session: ConformanceSession, subject: Subject) -> Iterator[tuple[str, CaseResult]]:
    try:
        for result in run_cases(session, subject):
            yield wire, result
    finally:
        session.close()
