"""Every installed driver on wires that go wrong; and that the suite finds drivers which are wrong."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compd.conformance import DriverUnderTest, driver_under_test, faults, run_conformance
from compd.conformance.faults import Fault
from compd.conformance.harness import ASKED_AGAIN_TIMEOUTS
from compd.conformance.report import CaseResult, Subject, run_case
from compd.conformance.value_cases import share_of
from compd.gauge import ByteLine, Channel, Gauge, GaugeOptions, LineFault, Quality, Reading, bad, good
from compd.gauge_tools import polled_drivers
from compd.lines import RtuMaster
from compd.twins import SimulatedByteDevice
from tests.support.sampled import sampled

NAMES = polled_drivers()


def failures(results: Sequence[tuple[str, CaseResult]]) -> list[str]:
    return [f"{wire}: {result.case}: {result.observed}" for wire, result in results if result.verdict == "FAIL"]


@pytest.mark.parametrize("name", sampled(NAMES, 8))
def test_installed_driver_in_virtual_time(name: str) -> None:
    results = list(run_conformance(driver_under_test(name), on_real_wires=False))
    assert failures(results) == []
    assert sum(result.verdict == "pass" for _, result in results) >= 12


@pytest.mark.long
def test_a_line_that_never_learns_where_a_map_ends_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RtuMaster, "_may_extend", lambda *_: True)
    results = list(run_conformance(driver_under_test("modbus"), on_real_wires=False))
    assert any("the map ends" in text and "no reply, still: timeout" in text for text in failures(results))


@pytest.mark.long
@pytest.mark.sample
def test_a_driver_on_ptys_and_ports() -> None:
    results = list(run_conformance(driver_under_test("heidenhain_nd28x")))
    assert failures(results) == []
    assert len({wire for wire, _ in results}) == 3


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_every_driver_on_ptys_and_ports(name: str) -> None:
    assert failures(list(run_conformance(driver_under_test(name)))) == []


@pytest.mark.long
@pytest.mark.parametrize(
    ("form", "error"),
    [
        ("%+08.3f", {"in": "+999.999", "quality": "over_range"}),
        ("%*1[0-9],%+08.3f", {"in": "3,%*8c", "quality": "sensor_fault"}),
    ],
)
def test_described_errors_that_look_like_values_are_tried(form: str, error: dict[str, str]) -> None:
    options = {
        "out": "?",
        "out_terminator": r"\r",
        "in": form,
        "in_terminator": r"\r",
        "channels": [{"name": "a", "unit": "mm"}],
        "errors": [error],
    }
    results = [result for _, result in run_conformance(driver_under_test("serial_ascii", options), False)]
    assert [result.observed for result in results if result.verdict == "FAIL"] == []
    (errors,) = [result for result in results if result.case == "error replies"]
    assert errors.observed.startswith(error["quality"])


@pytest.mark.parametrize(("failing", "exact", "verdict"), [(1, False, "pass"), (3, False, "FAIL"), (1, True, "FAIL")])
def test_a_computer_may_be_late_by_chance_in_real_time_and_a_driver_wrong_never(
    failing: int, exact: bool, verdict: str
) -> None:
    results = iter(["FAIL"] * failing + ["pass"] * 3)
    case = Mock(side_effect=lambda session, subject: CaseResult("late", "ok", "timeout", next(results)))
    subject = Subject(registers=False, over_tcp=True, checksum=False, exact=exact, error_replies={})
    assert run_case(case, Mock(), subject).verdict == verdict


# --- random interleavings ------------------------------------------------------------------------------------

# outside numbers, names and terminators
GARBAGE_BYTES = bytes([0x00, 0x04, 0x1F, 0x23, 0x7E, 0x80, 0xAA, 0xF8, 0xFE, 0xFF])
junk = st.lists(st.sampled_from(list(GARBAGE_BYTES)), min_size=1, max_size=9).map(bytes)
share = st.floats(0.0, 1.0)
harmless_to_format = st.one_of(
    st.just(faults.NONE),
    st.just(faults.SILENT),
    st.just(faults.doubled()),
    junk.map(faults.garbage_before),
    junk.map(faults.garbage_after),
    st.builds(faults.garbage_inside, share, junk),
    st.builds(faults.cut, share),
    st.builds(faults.split, share, st.floats(0.0, 0.9)),
    # until the gauge is asked again; what is later is the business of the line's thread (test_reply_order.py)
    st.builds(faults.late, st.floats(1.05, ASKED_AGAIN_TIMEOUTS - 0.1)),
)
modbus_only = st.one_of(
    st.builds(faults.flipped, st.integers(0, 10_000)),
    st.sampled_from(["unit", "function", "length"]).map(lambda what: faults.forged(what, False)),  # type: ignore[arg-type]
    st.sampled_from([1, 2, 3, 4, 6]).map(lambda code: faults.refused(code, False)),
    st.binary(max_size=40).map(faults.replaced),
)
with_checksum = st.one_of(harmless_to_format, st.builds(faults.flipped, st.integers(0, 10_000)))


def run_through(driver: DriverUnderTest, polls: Sequence[Sequence[Fault]]) -> None:
    """No poll under any of the faults gives a wrong number, and when they end the readings are right."""
    session = driver.virtual()
    assert session.calibrate() is None
    for faults_by_reply in polls:
        poll = session.poll(faults_by_reply)
        assert not poll.wrong, (faults_by_reply, poll)
    session.settle()
    count, poll = session.recover()
    assert poll.ok, (count, poll)
    assert session.poll().ok


@pytest.mark.parametrize("name", sampled(NAMES, 16))
@settings(max_examples=60)
@given(data=st.data())
def test_no_interleaving_of_faults_gives_a_wrong_number(name: str, data: st.DataObject) -> None:
    driver = driver_under_test(name)
    kinds = harmless_to_format
    if driver.registers:
        kinds = st.one_of(harmless_to_format, modbus_only)
    elif driver.gauge.integrity == "checksum":
        kinds = with_checksum
    run_through(driver, data.draw(st.lists(st.lists(kinds, max_size=3), max_size=8), label="faults by poll and reply"))


# --- the suite finds what is wrong ---------------------------------------------------------------------------


class Scale(SimulatedByteDevice):
    """Answers ? by +0.1234 CR LF."""

    def receive(self, data: bytes) -> bytes:
        value = self.sense("value")
        shown = "ERROR" if math.isnan(value) else f"{value:+.4f}"
        return b"".join(f"{shown}\r\n".encode() for byte in data if byte == ord("?"))


class Careful(Gauge[ByteLine]):
    """Right; the others differ from it in one way each."""

    def __init__(self, options: Any) -> None:
        super().__init__(options)
        self.scale = 1.0

    @property
    def channels(self) -> Sequence[Channel]:
        return (Channel("value"),)

    def read(self, line: ByteLine) -> Sequence[Reading]:
        time_s = line.send(b"?")
        reply = line.receive_until(b"\r\n", 16)
        if reply == b"ERROR\r\n":
            return [bad(time_s, Quality.SENSOR_FAULT)]
        if not re.fullmatch(rb"[+-]\d\.\d{4}\r\n", reply):
            raise LineFault(Quality.MISMATCH, repr(reply))
        return [good(self.scale * float(reply), time_s)]


class Micrometres(Careful):
    def __init__(self, options: Any) -> None:
        super().__init__(options)
        self.scale = 1e3


class StampsTheAnswer(Careful):
    """Its time is when the reply was read: an age that looks younger than it is."""

    def read(self, line: ByteLine) -> Sequence[Reading]:
        (reading,) = super().read(line)
        line.drain()
        return [reading._replace(time_s=reading.time_s + 0.02)]


class Trusting(Careful):
    """Takes the first number that it finds anywhere."""

    def read(self, line: ByteLine) -> Sequence[Reading]:
        time_s = line.send(b"?")
        reply = line.receive(9)
        digits = bytes(byte for byte in reply if byte in b"+-.0123456789")
        try:
            return [good(float(digits), time_s)]
        except ValueError:
            return [bad(time_s, Quality.MISMATCH)]


class Remembering(Careful):
    """Gives the last number again when nothing comes."""

    _last: Sequence[Reading] = ()

    def read(self, line: ByteLine) -> Sequence[Reading]:
        try:
            self._last = super().read(line)
        except LineFault:
            if not self._last:
                raise
        return self._last


class CutOff(Careful):
    """Calls a device's silence a sensor's fault."""

    def read(self, line: ByteLine) -> Sequence[Reading]:
        try:
            return super().read(line)
        except LineFault as fault:
            if fault.quality is not Quality.TIMEOUT:
                raise
            return [bad(line.send(b""), Quality.SENSOR_FAULT)]


def driver_of(gauge: type[Gauge[Any]], options: Mapping[str, Any] | None = None) -> DriverUnderTest:
    return DriverUnderTest("x", gauge, Scale, GaugeOptions(driver="x", line="test", **(options or {})))


def test_a_careful_driver_passes() -> None:
    assert failures(list(run_conformance(driver_of(Careful), on_real_wires=False))) == []


@pytest.mark.parametrize(
    ("gauge", "case"),
    sampled(
        [
            (Micrometres, "units and scale"),
            (StampsTheAnswer, "units and scale"),
            (Remembering, "no reply"),
            (Trusting, "garbage inside the reply"),
            (CutOff, "no reply"),
        ],
        2,
    ),
)
def test_a_wrong_driver_is_found(gauge: type[Gauge[Any]], case: str) -> None:
    results = list(run_conformance(driver_of(gauge), on_real_wires=False))
    assert case in {result.case for _, result in results if result.verdict == "FAIL"}, results


def test_flips_that_a_wire_cannot_show_are_said_and_not_hidden() -> None:
    results = {result.case: result for _, result in run_conformance(driver_of(Careful), on_real_wires=False)}
    flips = results["one bit turned"]
    assert flips.verdict == "-"
    assert "not detectable on this wire" in flips.observed


def test_a_checksum_that_is_not_checked_is_a_failure() -> None:
    class Claims(Careful):
        integrity = "checksum"

    results = list(run_conformance(driver_of(Claims), on_real_wires=False))
    assert "one bit turned" in {result.case for _, result in results if result.verdict == "FAIL"}


def test_error_replies_that_the_simulated_device_names_are_tried() -> None:
    class WithErrors(Scale):
        error_replies = {b"ERROR\r\n": "sensor_fault", b"E9\r\n": "device_error"}  # noqa: RUF012

    options = GaugeOptions(driver="x", line="test")
    results = list(run_conformance(DriverUnderTest("x", Careful, WithErrors, options), on_real_wires=False))
    assert any("device_error" in result.required and result.verdict == "FAIL" for _, result in results)


def test_real_wire_replugs(tmp_path: Path) -> None:
    session = driver_of(Careful).real("serial", tmp_path)
    try:
        assert session.poll().ok
        session.wire.unplug()
        assert not session.poll().ok
        assert session.poll().qualities == {Quality.LINE_LOST}
        session.wire.replug()
        assert session.recover()[1].ok
    finally:
        session.close()


@pytest.mark.parametrize("logarithmic", [False, True])
def test_no_value_is_beyond_a_range_that_ends_within_a_digit_of_zero(logarithmic: bool) -> None:
    """A humidity from 0: what the device rounds to 0 counts as shown."""
    session = Mock()
    session.sensors.whole = session.sensors.extents = {"humidity": (-0.05, 100.0)}
    session.replies.digit = {"humidity": 0.1}
    shares = [number / 200 for number in range(201)]
    values = [share_of(session, "humidity", share, logarithmic) for share in shares]
    assert all(-0.05 <= value <= 100.0 + 1e-9 for value in values)
