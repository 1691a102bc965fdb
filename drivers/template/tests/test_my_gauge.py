"""Replies from the manual, byte by byte; then every fault of a wire."""

from __future__ import annotations

import pytest
from my_gauge.driver import MyGauge
from my_gauge.simulated import SimulatedMyGauge

from compd.conformance import DriverUnderTest, run_conformance
from compd.gauge import LineFault, Quality, Reading


class Transcript:
    """A line with exactly one request and one reply: a byte left over is an error."""

    def __init__(self, sent: bytes, received: bytes) -> None:
        self._sent = sent
        self.waiting = received

    def send(self, request: bytes) -> float:
        assert request == self._sent
        return 12.5

    def receive_until(self, terminator: bytes, limit: int, timeout_s: float | None = None) -> bytes:
        reply, end, self.waiting = self.waiting.partition(terminator)
        assert end
        assert len(reply + end) <= limit
        return reply + end


def gauge(unit: str) -> MyGauge:
    return MyGauge(MyGauge.Options(driver="my_gauge", line="x", unit=unit))


def read(unit: str, received: bytes) -> Reading:
    line = Transcript(b"?\r", received)
    (reading,) = gauge(unit).read(line)
    assert line.waiting == b""
    return reading


@pytest.mark.parametrize(
    ("unit", "received", "value_mm"),
    [("mm", b"+01.2345mm\r\n", 1.2345), ("mm", b"-00.0001mm\r\n", -0.0001), ("in", b"+01.0000in\r\n", 25.4)],
)
def test_values(unit: str, received: bytes, value_mm: float) -> None:
    assert read(unit, received) == Reading(pytest.approx(value_mm), 12.5, Quality.OK)


@pytest.mark.parametrize(
    ("received", "quality"),
    [
        (b"ER01\r\n", Quality.SENSOR_FAULT),
        (b"ER02\r\n", Quality.OVER_RANGE),
        (b"ER03\r\n", Quality.UNDER_RANGE),
        (b"ER77\r\n", Quality.DEVICE_ERROR),
    ],
)
def test_errors(received: bytes, quality: Quality) -> None:
    assert read("mm", received).quality is quality


@pytest.mark.parametrize("received", [b"\r\n", b"+1.2345mm\r\n", b"+01.234mm\r\n", b"+01.2345in\r\n", b"01.2345mm\r\n"])
def test_anything_else_is_no_number(received: bytes) -> None:
    with pytest.raises(LineFault) as caught:
        read("mm", received)
    assert caught.value.quality is Quality.MISMATCH


@pytest.mark.parametrize("unit", ["mm", "in"])
def test_every_fault_of_a_wire(unit: str) -> None:
    driver = DriverUnderTest("my_gauge", MyGauge, SimulatedMyGauge, gauge(unit).options)
    results = list(run_conformance(driver, on_real_wires=False))
    assert [f"{result.case}: {result.observed}" for _, result in results if result.verdict == "FAIL"] == []
