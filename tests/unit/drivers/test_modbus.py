"""Generic register map: numbers out of registers, reads out of a map, and values that are none."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from compd.gauge import LineFault, Quality, Reading, RegisterReply
from compd_drivers.modbus import Modbus, RegisterBlock, blocks
from compd_drivers.modbus_description import ModbusChannel
from compd_drivers.modbus_number import decode


def channel(**keys: Any) -> dict[str, Any]:
    return {"name": "a", "function": 4, "address": 0, "type": "int16", "unit": "mm", **keys}


class Map:
    """A line whose registers are given."""

    def __init__(self, registers: Mapping[int, int]) -> None:
        self.registers = registers
        self.asked: list[tuple[int, int, int, int]] = []

    def read_registers(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        self.asked.append((unit, function, address, count))
        return RegisterReply(tuple(self.registers[i] for i in range(address, address + count)), float(len(self.asked)))


def options(*channels: dict[str, Any]) -> Any:
    return Modbus.Options.model_validate({"driver": "modbus", "line": "l", "unit": 5, "channels": channels})


def read(registers: list[int], *channels: dict[str, Any]) -> list[Reading]:
    return list(Modbus(options(*channels)).read(Map(dict(enumerate(registers)))))


@pytest.mark.parametrize(
    ("kind", "order", "byte_order", "registers", "value"),
    [
        ("int16", "high_first", "big", [0xFF38], -200.0),
        ("uint16", "high_first", "big", [0xFF38], 65336.0),
        ("uint16", "high_first", "little", [0x3412], 0x1234),
        ("int32", "high_first", "big", [0xFFFF, 0xFFFE], -2.0),
        ("int32", "low_first", "big", [0xFFFE, 0xFFFF], -2.0),
        ("uint32", "low_first", "little", [0x0400, 0x0200], 0x00020004),
        ("float32", "high_first", "big", [0x3F80, 0x0000], 1.0),
        ("float32", "low_first", "big", [0x0000, 0xC000], -2.0),
        ("float32", "high_first", "little", [0x803F, 0x0000], 1.0),
        ("int64", "high_first", "big", [0xFFFF, 0xFFFF, 0xFFFF, 0xFFFE], -2.0),
        ("uint64", "low_first", "big", [1, 2, 0, 0], 0x20001),
        ("float64", "high_first", "big", [0xBFC0, 0, 0, 0], -0.125),
        ("float64", "low_first", "little", [0, 0, 0, 0xC0BF], -0.125),
        ("bcd16", "high_first", "big", [0x1234], 1234.0),
        ("bcd32", "high_first", "big", [0x1234, 0x5678], 12345678.0),
        ("bcd32", "low_first", "big", [0x5678, 0x1234], 12345678.0),
    ],
)
def test_numbers_out_of_registers(kind: str, order: str, byte_order: str, registers: list[int], value: float) -> None:
    made = ModbusChannel.model_validate(channel(type=kind, word_order=order, byte_order=byte_order))
    assert decode(made, registers) == value


@pytest.mark.parametrize(
    ("keys", "registers", "value"),
    [
        # Beckhoff IP5209: word 0 is D0 and the status, word 1 is D2 and D1
        ({"type": "uint24", "word_order": "low_first"}, [0xD055, 0xD2D1], 0xD2D1D0),
        ({"type": "int24", "word_order": "low_first"}, [0xFE55, 0xFFFF], -2.0),
        ({"type": "int16", "at_byte": 1}, [0x55FF, 0xFE55], -2.0),
        ({"type": "float32", "at_byte": 1}, [0x55BE, 0x0000, 0x0055], -0.125),
        ({"type": "int8"}, [0xFE55], -2.0),
        ({"type": "uint8", "at_byte": 1}, [0x55FE], 254.0),
        ({"type": "uint8", "byte_order": "little"}, [0x55FE], 254.0),
        ({"type": "int16", "mask": 0xFFF0, "shift": 4}, [0xFFE5], -2.0),
        ({"type": "uint16", "mask": 0xFFF0, "shift": 4}, [0xFFE5], 0xFFE),
        ({"type": "int32", "mask": 0x00FFFF00, "shift": 8}, [0x55FF, 0xFE55], -2.0),
        ({"type": "uint16", "mask": 0x0003}, [0xFFFE], 2.0),
        ({"type": "uint16", "minus": 0x8000}, [0x8002], -2.0),
        ({"type": "uint16", "minus": 0x8000, "mask": 0x0FFF}, [0xF002], -2.0),
        ({"type": "bcd16", "minus": 0x8000, "mask": 0x0FFF}, [0x8123], -123.0),
        ({"type": "bcd16", "minus": 0x8000}, [0x8123], -123.0),
    ],
)
def test_numbers_that_are_parts_of_registers(keys: dict[str, Any], registers: list[int], value: float) -> None:
    made = ModbusChannel.model_validate(channel(**keys))
    assert made.length == len(registers)
    assert decode(made, registers) == value


def test_what_is_no_decimal_digit_is_no_number() -> None:
    (reading,) = read([0x12A4], channel(type="bcd16"))
    assert reading.quality is Quality.MISMATCH
    assert reading.detail == "12A4 are no decimal digits, see `type` and `mask`"


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ({"type": "float32", "mask": 1}, "belong to whole numbers"),
        ({"type": "int16", "mask": 0x10000}, "beyond int16"),
        ({"type": "int16", "mask": 0xFF00}, "side by side"),
        ({"type": "int16", "mask": 0xFF00, "shift": 9}, "side by side"),
        ({"type": "int16", "mask": 0x0F0F}, "side by side"),
        ({"type": "int16", "shift": 4}, "needs a `mask`"),
        ({"type": "int16", "minus": 0x8000}, "a sign of its own"),
        ({"type": "uint16", "minus": 0x8001}, "must be one bit"),
        ({"type": "uint16", "minus": 0x0001, "mask": 0x0003}, "must not stand in `mask`"),
        ({"type": "bit"}, "functions 1 and 2 read type bit"),
        ({"function": 2}, "functions 1 and 2 read type bit"),
        ({"type": "bit", "function": 2, "at_byte": 1}, "has no `at_byte`"),
        ({"address": 65535, "at_byte": 1}, "beyond register 65535"),
        ({"status": {"address": 1, "mask": 0x0C, "ok": [1]}}, "it never comes"),
    ],
)
def test_numbers_that_cannot_be_are_refused(keys: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        options(channel(**keys))


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_every_float_survives(value: float) -> None:
    made = ModbusChannel.model_validate(channel(type="float32"))
    assert decode(made, struct.unpack(">HH", struct.pack(">f", value))) == value


def test_scale_and_offset_give_the_unit() -> None:
    (reading,) = read([0x10000 - 125], channel(scale=0.1, offset=-1.0, unit="degC"))
    assert reading.quality is Quality.OK
    assert reading.value == pytest.approx(-13.5)


@pytest.mark.parametrize(
    ("registers", "keys", "quality"),
    [
        ([0x8000], {"invalid": [-32768]}, Quality.SENSOR_FAULT),
        ([0xFFFF], {"type": "uint16", "invalid": [65535]}, Quality.SENSOR_FAULT),
        ([0x7FC0, 0], {"type": "float32"}, Quality.NOT_FINITE),
        ([0xFF80, 0], {"type": "float32"}, Quality.NOT_FINITE),
        ([1001], {"highest": 1000.0}, Quality.OVER_RANGE),
        ([0xFFFF], {"lowest": 0.0}, Quality.UNDER_RANGE),
        ([5, 1], {"status": {"address": 1}}, Quality.SENSOR_FAULT),
        ([5, 2], {"status": {"address": 1, "over_range": [2]}}, Quality.OVER_RANGE),
        ([5, 3], {"status": {"address": 1, "under_range": [3]}}, Quality.UNDER_RANGE),
        ([5, 0], {"status": {"address": 1}}, Quality.OK),
        ([5, 7], {"status": {"address": 1, "ok": [6, 7]}}, Quality.OK),
        ([5, 0xF3], {"status": {"address": 1, "mask": 0x0C}}, Quality.OK),
        ([5, 0xF4], {"status": {"address": 1, "mask": 0x0C}}, Quality.SENSOR_FAULT),
        ([5, 0xF8], {"status": {"address": 1, "mask": 0x0C, "over_range": [8]}}, Quality.OVER_RANGE),
        ([0xD005, 0], {"type": "uint8", "status": {"address": 0, "mask": 0x0C}}, Quality.SENSOR_FAULT),
    ],
)
def test_values_that_are_none_are_named(registers: list[int], keys: dict[str, Any], quality: Quality) -> None:
    (reading,) = read(registers, channel(**keys))
    assert reading.quality is quality
    assert math.isnan(reading.value) == (quality is not Quality.OK)


def test_adjacent_registers_are_read_together_and_stamped_with_their_own_read() -> None:
    gauge = Modbus(
        options(
            channel(name="a", address=4, type="float32"),
            channel(name="b", address=0, type="int16"),
            channel(name="c", address=6),
            channel(name="d", function=3, address=7),
        )
    )
    line = Map({0: 1, 4: 0x3F80, 5: 0, 6: 3, 7: 4})
    readings = gauge.read(line)
    assert line.asked == [(5, 3, 7, 1), (5, 4, 0, 1), (5, 4, 4, 3)]
    assert [reading.value for reading in readings] == [1.0, 1.0, 3.0, 4.0]
    assert [reading.time_s for reading in readings] == [3.0, 2.0, 3.0, 1.0]


@given(
    st.lists(st.tuples(st.sampled_from([3, 4]), st.integers(0, 400), st.sampled_from([1, 2])), min_size=1, max_size=200)
)
def test_every_number_is_whole_in_one_read(spans: list[tuple[int, int, int]]) -> None:
    reads = blocks(spans)
    assert all(1 <= block.length <= 124 for block in reads)
    for function, address, length in spans:
        assert any(
            block.function == function and block.address <= address and address + length <= block.address + block.length
            for block in reads
        )


def test_a_long_map_is_split_between_numbers() -> None:
    assert blocks([(4, 2 * i, 2) for i in range(63)]) == (RegisterBlock(4, 0, 124), RegisterBlock(4, 124, 2))


def test_a_block_that_fails_leaves_no_values() -> None:
    class Broken(Map):
        def read_registers(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
            raise LineFault(Quality.CRC, "b'..'")

    with pytest.raises(LineFault, match="crc"):
        Modbus(options(channel())).read(Broken({}))


@pytest.mark.parametrize(
    ("channels", "problem"),
    [
        ([channel(), channel(address=1)], "channel named twice: a"),
        ([channel(address=65535, type="float32")], "beyond register 65535"),
        ([channel(unit="um")], "unit"),
        ([channel(function=5)], "function"),
        ([channel(scale=math.inf)], "scale"),
        ([], "channels"),
    ],
)
def test_maps_that_cannot_be_are_refused(channels: list[dict[str, Any]], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        options(*channels)


def registers_of(value: float, order: str) -> list[int]:
    """A float32 as libmodbus writes it: ABCD, CDAB, BADC or DCBA."""
    data = struct.pack(">f", value)
    shuffled = bytes(data["ABCD".index(letter)] for letter in order)
    return [int.from_bytes(shuffled[:2], "big"), int.from_bytes(shuffled[2:], "big")]


def test_a_float_in_a_wrong_order_of_bytes_is_no_quiet_zero() -> None:
    (reading,) = read(registers_of(-0.125, "DCBA"), channel(type="float32", lowest=-1, highest=1))
    assert reading.quality is Quality.MISMATCH
    assert reading.detail.startswith("byte order? 2.662e-43 (high_first, big) is no measurement")
    assert "-0.125 (low_first, little)" in reading.detail, "all orders stand side by side"
    (right,) = read(registers_of(-0.125, "DCBA"), channel(type="float32", word_order="low_first", byte_order="little"))
    assert right.value == -0.125


@pytest.mark.parametrize("value", [0.0, -0.0, 1e-12, -3e7])
def test_zero_and_small_numbers_are_measurements(value: float) -> None:
    (reading,) = read(registers_of(value, "ABCD"), channel(type="float32"))
    assert reading.value == pytest.approx(value, rel=1e-6)


@pytest.mark.parametrize("value", [1e-21, -1e-40, 1e30])
def test_no_instrument_shows_such_numbers(value: float) -> None:
    (reading,) = read(registers_of(value, "ABCD"), channel(type="float32"))
    assert reading.quality is Quality.MISMATCH
