"""Simulated lines: what a person, or `compd sim run`, can do with them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from compd.clock import MonotonicClock
from compd.gauge import LineFault, Quality
from compd.lines.line_definition import PolledDefinition
from compd.lines.open import KINDS
from compd.lines.port_arguments import PortArguments
from compd.simulation.wires.simulated_line import SimulatedLine
from compd.twins import SimulatedByteDevice
from tests.support.wire_rig import SETTINGS, outcome, rig

RTU = {"kind": "modbus_rtu", "port": "x", "baud": 115200, "format": "8N1", "timeout_s": 0.1}
SLOW = {"kind": "serial", "port": "x", "baud": 1200, "format": "7E2", "timeout_s": 1.0}


def room(unit: int) -> dict[str, Any]:
    channel = {"name": "room", "function": 4, "address": 0, "type": "int16", "unit": "degC", "scale": 0.01}
    return {"driver": "modbus", "unit": unit, "channels": [channel]}


class Echo(SimulatedByteDevice):
    """Answers everything with the same."""

    def __init__(self, answer: bytes) -> None:
        super().__init__(None, lambda channel: 0.0)
        self._answer = answer

    def receive(self, data: bytes) -> bytes:
        return self._answer if data else b""


def test_units_on_one_line_answer_to_their_own_number(tmp_path: Path) -> None:
    with rig(tmp_path, RTU, {"a": room(1), "b": room(2)}, {"room": 20.5}) as bench:
        with bench.open() as line:
            for name in ("a", "b", "a"):
                assert outcome(bench.gauges[name], line) == [(Quality.OK, pytest.approx(20.5))]
        with bench.open(0.1) as line, pytest.raises(LineFault) as caught:
            line.read_registers(3, 4, 0, 1)
        assert caught.value.quality is Quality.TIMEOUT


def test_noise_before_a_request_does_not_deafen_a_slave(tmp_path: Path) -> None:
    with rig(tmp_path, RTU, {"a": room(1)}, {"room": 20.5}) as bench, bench.open() as line:
        fd = os.open(bench.settings.port, os.O_WRONLY | os.O_NOCTTY)  # type: ignore[arg-type]
        os.write(fd, b"\x00\xff\x01")
        os.close(fd)
        assert outcome(bench.gauges["a"], line) == [(Quality.OK, pytest.approx(20.5))]


def test_the_port_is_a_link_that_goes_and_comes_with_the_plug(tmp_path: Path) -> None:
    with rig(tmp_path, SLOW, {"g": {"driver": "heidenhain_nd28x"}}, {"position": 1.0}) as bench:
        link = tmp_path / "line"
        assert str(link.readlink()).startswith("/dev/pts/")
        bench.wire.fault = "unplugged"
        assert not link.is_symlink()
        bench.wire.fault = None
        assert link.is_symlink()
        with bench.open() as line:
            assert outcome(bench.gauges["g"], line) == [(Quality.OK, 1.0)]
    assert not link.is_symlink()


def test_a_reply_leaves_at_the_pace_of_the_line(tmp_path: Path) -> None:
    """No character comes before its time: 11 bits each at 1200 baud."""
    clock = MonotonicClock()
    wire = SimulatedLine("slow", SETTINGS.validate_python(SLOW), [Echo(b"12345678901234567")], tmp_path)
    fd = os.open(str(wire.start()), os.O_RDWR | os.O_NOCTTY)
    start_s = clock.monotonic()
    os.write(fd, b"\x02")
    received = b""
    while len(received) < 17:
        received += os.read(fd, 100)
        assert len(received) <= (clock.monotonic() - start_s) * 1200 / 11
    os.close(fd)
    wire.stop()
    assert received == b"12345678901234567"


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if isinstance(kind, PolledDefinition)])
def test_a_fault_that_there_is_not_is_refused_and_the_others_named(tmp_path: Path, kind: str) -> None:
    port = KINDS[kind].port_keys(PortArguments(KINDS[kind].example_port, 9600, "8N1", 0.1))
    settings = SETTINGS.validate_python({"kind": kind, "timeout_s": 0.1, **port})
    line = SimulatedLine("line", settings, [], tmp_path)
    with pytest.raises(RuntimeError, match="start it first"):
        line.fault = "silent"
    line.start()
    with pytest.raises(ValueError, match="silent, garble, late, cut, doubled"):
        line.fault = "on fire"
    assert line.fault is None
    for fault in line.faults:
        line.fault = fault
        assert line.fault == fault
    line.stop()


def test_a_tcp_line_keeps_its_port_through_an_unplugging(tmp_path: Path) -> None:
    settings = {"kind": "modbus_tcp", "host": "x", "timeout_s": 0.1}
    with rig(tmp_path, settings, {"a": room(1)}, {"room": 20.5}) as bench:
        bench.wire.fault = "unplugged"
        with pytest.raises(LineFault, match="line_lost"), bench.open():
            pass
        bench.wire.fault = None
        with bench.open() as one, bench.open() as two:
            assert outcome(bench.gauges["a"], two) == outcome(bench.gauges["a"], one)
