"""Two-wire adapters that repeat what is sent: taken out where the line says so, and recognised where it does not."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from compd.gauge import LineFault, Quality
from compd.lines.echo import HINT, explained
from compd.lines.kinds.modbus_rtu.master import RtuMaster
from compd.lines.stream import StreamLine
from compd.live.acquisition.acquisition import LineThread
from compd.live.memory import Latest
from tests.support.ascii_gauge import gauge
from tests.support.patience import PATIENCE_S
from tests.support.wire_rig import SETTINGS, InstantClock, ScriptedPort
from tests.unit.lines.test_modbus_rtu import counting_slave

Device = Callable[[bytes], bytes]


def repeating(device: Device) -> Device:
    """The device behind an adapter that repeats what is sent."""
    return lambda request: request + device(request)


def stream(device: Device, echo: bool) -> StreamLine:
    clock = InstantClock()
    return StreamLine(ScriptedPort(clock, device=device), 0.1, 0.002, clock, echo)


def test_the_echo_is_taken_out() -> None:
    line = RtuMaster(stream(repeating(counting_slave()), echo=True))
    for _ in range(3):
        assert line.read_registers(1, 4, 10, 2).registers == (1010, 1011)
    assert line.unexpected_bytes == 0
    text = stream(repeating(lambda request: b"+1.5\r\n"), echo=True)
    assert gauge(**{"in": "%f"}).read(text)[0].value == 1.5


def fault_of(line: StreamLine | RtuMaster) -> LineFault:
    def poll() -> object:
        return line.read_registers(1, 4, 10, 2) if isinstance(line, RtuMaster) else gauge(**{"in": "%f"}).read(line)

    with pytest.raises(LineFault) as caught:
        poll()
    return caught.value


def test_an_echo_that_is_expected_and_does_not_come_or_is_another() -> None:
    missing = fault_of(stream(lambda request: b"", echo=True))
    assert missing.quality is Quality.TIMEOUT
    assert "the adapter has not repeated the request" in missing.detail
    assert fault_of(stream(lambda request: b"+1.5\r\n", echo=True)).quality is Quality.MISMATCH


@pytest.mark.parametrize("device", [counting_slave(), lambda request: b""])
def test_an_echo_that_is_not_expected_is_recognised_and_said(device: Device) -> None:
    line = RtuMaster(stream(repeating(device), echo=False))
    assert HINT in explained(fault_of(line), line).detail
    text = stream(repeating(lambda request: b"+1.5\r\n"), echo=False)
    assert HINT in explained(fault_of(text), text).detail


@pytest.mark.parametrize("reply", [b"", b"?", b"ER\r\n", b"garbage\r\n"])
def test_other_faults_have_no_such_hint(reply: bytes) -> None:
    line = stream(lambda request: reply, echo=False)
    fault = fault_of(line)
    assert explained(fault, line) is fault


def test_the_daemon_says_it() -> None:
    """In the detail of the gauge's fault, which STATUS and the page show."""
    clock = InstantClock()
    settings = SETTINGS.validate_python({"kind": "tcp", "host": "x", "port": 1, "timeout_s": 0.1})
    thread: LineThread

    def opened(*_: object) -> StreamLine:
        return StreamLine(ScriptedPort(clock, device=device), 0.1, 0.002, clock)

    def device(request: bytes) -> bytes:
        if clock.now_s > 105:
            thread.stop()
        return request + b"+1.5\r\n"

    dial = gauge(**{"in": "%f"})
    thread = LineThread("line", settings, [("dial", dial)], {"dial": 1.0}, Latest(["dial.value"]), clock, opened)
    thread.start()
    assert thread.join(PATIENCE_S)
    assert HINT in thread.gauges[0].detail
