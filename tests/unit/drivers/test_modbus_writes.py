"""What a Modbus gauge reads and writes beside its registers: bits, an identity, a start, a latch; on real lines too."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from compd.commissioning.conformance.report import driver_under_test, run_conformance
from compd.gauge import LineFault, Quality, RegisterReply
from compd.lines.kinds.modbus_rtu.master import RtuMaster, crc16
from compd.lines.stream import StreamLine
from compd.twins.modbus_slaves import ModbusSlaves
from compd_drivers.modbus import Modbus
from compd_drivers.simulated.modbus import SimulatedRegisters
from tests.support.wire_rig import InstantClock, ScriptedPort, rig

VALUE = {"name": "value", "function": 3, "address": 0, "type": "int16", "scale": 0.001, "unit": "mm"}
INCH = {"function": 6, "address": 40, "values": [1]}
START = {"function": 5, "address": 3, "values": [1], "settle_s": 0.05}
TABLE = {"function": 16, "address": 50, "values": [1, 2, 3]}
LATCH = {"function": 6, "address": 9, "values": [1], "unit": 0, "settle_s": 0.1}
RICH = {
    "unit": 7,
    "identity": {"function": 3, "address": 20, "equals": [0x1234, 42]},
    "write_first": [INCH, START, TABLE],
    "write_before_poll": [LATCH],
    "channels": [
        {**VALUE, "status": {"address": 5, "function": 2}},
        {"name": "field", "function": 4, "address": 0, "type": "int16", "mask": 0x0FF0, "shift": 4, "unit": "mm",
         "scale": 0.01, "status": {"address": 0, "mask": 0x3}},
        {"name": "packed", "function": 4, "address": 4, "type": "bcd16", "minus": 0x8000, "mask": 0x0FFF,
         "scale": 0.001, "unit": "mm", "lowest": -0.95},
        {"name": "double", "function": 4, "address": 6, "type": "float64", "word_order": "low_first", "unit": "mm"},
        {"name": "counter", "function": 4, "address": 10, "type": "int24", "at_byte": 1, "scale": 1e-5, "unit": "mm",
         "lowest": -1},
    ],
}  # fmt: skip
SEEN = {"value": -0.25, "field": 0.5, "packed": -0.123, "double": 0.125, "counter": -0.75}


def options(**keys: Any) -> Any:
    return Modbus.Options.model_validate({"driver": "modbus", "line": "l", "unit": 7, "channels": [VALUE], **keys})


class Slave:
    """A simulated slave on an RTU line in virtual time."""

    def __init__(self, described: Any, values: dict[str, float] | None = None) -> None:
        self.clock = InstantClock()
        self.device = SimulatedRegisters(described, (values or {"value": 0.5}).__getitem__)
        slaves = ModbusSlaves([self.device], over_tcp=False)
        self.port = ScriptedPort(self.clock, device=slaves.hear)
        self.line = RtuMaster(StreamLine(self.port, 0.1, 0.002, self.clock))

    @property
    def asked(self) -> list[str]:
        """Unit and function of each request."""
        return [f"{request[0]}:{request[1]}" for request in self.port.written]


def test_a_rich_map_is_read() -> None:
    described = options(**RICH)
    slave = Slave(described, SEEN)
    readings = Modbus(described).read(slave.line)
    assert [reading.quality for reading in readings] == [Quality.OK] * 5
    assert [reading.value for reading in readings] == pytest.approx(list(SEEN.values()))


@pytest.mark.parametrize("kind", ["modbus_rtu", "modbus_tcp"])
def test_on_a_real_line(tmp_path: Path, kind: str) -> None:
    line = {"kind": kind, "timeout_s": 1.0}
    line |= {"host": "x"} if kind == "modbus_tcp" else {"port": "x", "baud": 115200, "format": "8N1"}
    without_broadcast = {**RICH, "driver": "modbus", "write_before_poll": [INCH]}
    with rig(tmp_path, line, {"rich": without_broadcast}, dict(SEEN)) as bench, bench.open() as opened:
        for _ in range(3):
            readings = bench.gauges["rich"].read(opened)
            assert [reading.value for reading in readings] == pytest.approx(list(SEEN.values()))


def test_the_order_of_things() -> None:
    """Who it is, what it needs, then before each poll the latch, to all slaves; it dates the readings."""
    described = options(**RICH)
    gauge, slave = Modbus(described), Slave(described, SEEN)
    readings = gauge.read(slave.line)
    assert slave.asked[:5] == ["7:3", "7:6", "7:5", "7:16", "0:6"]
    assert slave.device.written == [(6, 40, (1,)), (5, 3, (1,)), (16, 50, (1, 2, 3)), (6, 9, (1,))]
    assert slave.clock.waits_s == pytest.approx([0.05, 0.1])
    latched_s = slave.clock.now_s
    assert {reading.time_s for reading in readings} == {readings[0].time_s}
    assert readings[0].time_s < latched_s - 0.09
    del slave.port.written[:]
    gauge.read(slave.line)
    assert slave.asked[0] == "0:6", "once on a connection"


def test_another_device_has_no_values() -> None:
    slave = Slave(options(**{**RICH, "identity": {"function": 3, "address": 20, "equals": [0x1234, 43]}}), SEEN)
    with pytest.raises(LineFault, match="another device than `identity` says") as caught:
        Modbus(options(**RICH)).read(slave.line)
    assert caught.value.quality is Quality.MISMATCH
    assert slave.asked == ["7:3"], "nothing is written to it"


def test_after_a_fault_the_device_is_asked_again_who_it_is() -> None:
    described = options(**RICH)
    gauge, slave = Modbus(described), Slave(described, SEEN)
    gauge.read(slave.line)
    heard, slave.port._device = slave.port._device, lambda request: b""
    with pytest.raises(LineFault, match="timeout"):
        gauge.read(slave.line)
    slave.port._device = heard
    del slave.port.written[:]
    gauge.read(slave.line)
    assert slave.asked[:4] == ["7:3", "7:6", "7:5", "7:16"]


def test_a_write_that_is_refused_or_not_confirmed_is_a_fault_of_the_poll() -> None:
    described = options(write_first=[INCH])
    slave = Slave(options())  # whose map has no such register
    with pytest.raises(LineFault, match="exception 2"):
        Modbus(described).read(slave.line)
    clock = InstantClock()
    other = bytes([7, 6, 0, 40, 0, 2])
    port = ScriptedPort(clock, device=lambda request: other + crc16(other).to_bytes(2, "little"))
    with pytest.raises(LineFault, match="was confirmed") as caught:
        Modbus(described).read(RtuMaster(StreamLine(port, 0.1, 0.002, clock)))
    assert caught.value.quality is Quality.MISMATCH


def test_a_switch_by_function_2() -> None:
    class Bits:
        def read_bits(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
            assert (unit, function, address, count) == (7, 2, 100, 2)
            return RegisterReply((1, 0), 1.0)

    switch = {"function": 2, "type": "bit", "unit": "1"}
    gauge = Modbus(options(channels=[{**switch, "name": "a", "address": 100}, {**switch, "name": "b", "address": 101}]))
    assert [reading.value for reading in gauge.read(Bits())] == [1.0, 0.0]  # type: ignore[arg-type]
    assert gauge.traffic() == [(8, 6)]


def test_a_status_bit_that_is_not_set_right_leaves_its_channel_without_value() -> None:
    described = options(channels=[{**VALUE, "status": {"address": 5, "function": 1, "ok": [1]}}])
    for value, quality in ((0.5, Quality.OK), (math.nan, Quality.SENSOR_FAULT)):
        (reading,) = Modbus(described).read(Slave(described, {"value": value}).line)
        assert reading.quality is quality


@pytest.mark.long
def test_the_rich_map_on_wires_that_go_wrong() -> None:
    rich = {**RICH, "write_before_poll": []}
    results = list(run_conformance(driver_under_test("modbus", rich), on_real_wires=False))
    assert [result for _, result in results if result.verdict == "FAIL"] == []


@pytest.mark.parametrize(
    ("write", "problem"),
    [
        ({**INCH, "values": [1, 2]}, "writes one value"),
        ({**START, "values": [2]}, "a coil is 0 or 1"),
        ({**LATCH, "settle_s": 0}, "nobody answers unit 0"),
        ({**INCH, "values": [70000]}, "less than or equal to 65535"),
        ({**INCH, "function": 15}, "function"),
    ],
)
def test_writes_that_cannot_be_are_refused(write: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        options(write_first=[write])
