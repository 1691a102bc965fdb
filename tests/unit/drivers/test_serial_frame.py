"""The described binary gauge: frames, checksums, numbers in bytes, error frames."""

from __future__ import annotations

import importlib
import textwrap
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from compd.gauge import LineFault, Quality, Reading
from compd.lines import CHECKSUMS, StreamLine
from compd_drivers.serial_frame import SerialFrame
from compd_drivers.simulated.serial_frame import SimulatedFrame
from tests.support.wire_rig import InstantClock, ScriptedPort

CHANNEL = {"name": "gap", "at": 2, "type": "int16", "byte_order": "big", "unit": "um"}
SHORT = {
    "driver": "serial_frame",
    "line": "line",
    "out": "A5 01",
    "frame": "5A 01 .. .. CS",
    "channels": [CHANNEL],
    "checksum": {"kind": "sum8"},
}


def gauge(**options: Any) -> SerialFrame:
    return SerialFrame(SerialFrame.Options.model_validate({**SHORT, **options}))


def poll(device: SerialFrame, reply: bytes) -> list[Reading]:
    clock = InstantClock()
    return list(device.read(StreamLine(ScriptedPort(clock, device=lambda request: reply), 0.1, 0.002, clock)))


def fault(device: SerialFrame, reply: bytes) -> Quality:
    with pytest.raises(LineFault) as caught:
        poll(device, reply)
    return caught.value.quality


def framed(data: str) -> bytes:
    """With its sum."""
    raw = bytes.fromhex(data)
    return raw + bytes([sum(raw) % 256])


def test_the_checks_of_textbooks() -> None:
    """The check value of each: of the digits 1 to 9 (CRC RevEng catalogue)."""
    digits = b"123456789"
    assert CHECKSUMS["crc8"].value(digits) == 0xF4
    assert CHECKSUMS["crc16_modbus"].value(digits) == 0x4B37
    assert CHECKSUMS["crc16_modbus"].of(digits) == b"\x37\x4b"
    assert CHECKSUMS["sum8"].value(digits) == 0xDD
    assert (CHECKSUMS["negative_sum8"].value(digits) + 0xDD) % 256 == 0
    assert CHECKSUMS["xor8"].value(digits) == 0x31


def test_a_frame() -> None:
    (reading,) = poll(gauge(), framed("5A 01 FF 9C"))
    assert reading.value == pytest.approx(-0.1)
    assert fault(gauge(), framed("5A 01 FF 9C")[:-1] + b"\x00") is Quality.CRC
    assert fault(gauge(), framed("5A 02 FF 9C")) is Quality.MISMATCH
    assert fault(gauge(), framed("5A 01 FF 9C")[:-1]) is Quality.INCOMPLETE
    assert fault(gauge(), framed("5A 01 FF 9C") + b"\x00") is Quality.MISMATCH
    assert fault(gauge(), b"") is Quality.TIMEOUT


@pytest.mark.parametrize("kind", [kind for kind in CHECKSUMS if kind != "modbus_lrc"])
def test_every_turned_bit_is_found(kind: str) -> None:
    """The frame is the simulated device's: the two ends share no code."""
    places = " CS" * CHECKSUMS[kind].length  # type: ignore[index]
    device = gauge(frame="5A 01 .. .." + places, checksum={"kind": kind, "byte_order": "big"})
    reply = SimulatedFrame(device.options, lambda name: -0.25).receive(bytes.fromhex("A501"))
    assert poll(device, reply)[0].value == -0.25
    for bit in range(8 * len(reply)):
        damaged = bytearray(reply)
        damaged[bit // 8] ^= 1 << bit % 8
        assert fault(device, bytes(damaged)) is Quality.CRC


@pytest.mark.parametrize(
    ("kind", "order", "data", "value"),
    [
        ("int8", "big", "80", -128),
        ("uint8", "big", "80", 128),
        ("int16", "little", "9C FF", -100),
        ("uint16", "little", "9C FF", 65436),
        ("int24", "big", "FF FF 9C", -100),
        ("uint24", "little", "01 00 80", 8388609),
        ("int32", "big", "FF FF FF 9C", -100),
        ("uint32", "little", "01 00 00 80", 2147483649),
        ("float32", "little", "AE 47 61 3F", 0.8799999952316284),
        ("float32", "big", "3F 61 47 AE", 0.8799999952316284),
        ("float64", "big", "3F F8 00 00 00 00 00 00", 1.5),
    ],
)
def test_numbers(kind: str, order: str, data: str, value: float) -> None:
    dots = " ".join([".."] * len(bytes.fromhex(data)))
    channel = {"name": "n", "at": 1, "type": kind, "byte_order": order, "unit": "1"}
    device = gauge(frame=f"5A {dots} CS", channels=[channel])
    assert poll(device, framed(f"5A {data}"))[0].value == value


def test_numbers_that_are_none() -> None:
    channel = {**CHANNEL, "invalid": {32767: "over_range", -32768: "sensor_fault"}, "range": [-1, 1]}
    device = gauge(channels=[channel])
    assert poll(device, framed("5A 01 7F FF"))[0].quality is Quality.OVER_RANGE
    assert poll(device, framed("5A 01 80 00"))[0].quality is Quality.SENSOR_FAULT
    assert poll(device, framed("5A 01 7F FE"))[0].quality is Quality.OVER_RANGE, "32.766 mm is beyond the sensor"
    nan = gauge(frame="5A .. .. .. .. CS", channels=[{"name": "n", "at": 1, "type": "float32", "unit": "mm"}])
    assert poll(nan, framed("5A 00 00 C0 7F"))[0].quality is Quality.NOT_FINITE


def test_error_frames_may_be_shorter() -> None:
    device = gauge(errors=[{"frame": "15", "quality": "device_error", "says": "busy"}])
    (reading,) = poll(device, b"\x15")
    assert (reading.quality, reading.detail) == (Quality.DEVICE_ERROR, "15: busy")
    assert poll(device, framed("5A 01 FF 9C"))[0].ok
    assert fault(device, b"\x15\x00") is Quality.MISMATCH


def test_part_of_the_frame_under_its_checksum() -> None:
    device = gauge(
        frame="5A .. .. CS 01", checksum={"kind": "sum8", "first": 1, "end": 3}, channels=[{**CHANNEL, "at": 1}]
    )
    assert poll(device, bytes.fromhex("5A FF 9C 9B 01"))[0].value == pytest.approx(-0.1)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"frame": "5A 01 .. .."}, "CS"),
        ({"checksum": None}, "CS"),
        ({"frame": ".. .. .. ..", "checksum": None}, "fixed bytes"),
        ({"frame": "5A XX .. .. CS"}, "XX"),
        ({"frame": "5A CS .. .. CS", "checksum": {"kind": "crc16_modbus"}}, "together"),
        ({"channels": [{**CHANNEL, "at": 4}]}, "beyond"),
        ({"channels": [CHANNEL, CHANNEL]}, "twice"),
        ({"errors": [{"frame": "5A", "quality": "device_error"}]}, "beginning"),
        ({"errors": [{"frame": "5A 02 00 00 00 00", "quality": "device_error"}]}, "longer"),
        ({"checksum": {"kind": "sum8", "first": 9}}, "covers nothing"),
        ({"out": "A5 0"}, "hexadecimal"),
    ],
)
def test_a_description_that_cannot_be_right(options: dict[str, Any], why: str) -> None:
    with pytest.raises(ValidationError, match=why):
        gauge(**options)


def test_the_example_in_the_drivers_text() -> None:
    text = importlib.import_module(SerialFrame.__module__).__doc__ or ""
    block = textwrap.dedent("\n".join(line for line in text.splitlines() if line.startswith("    ")))
    device = SerialFrame(SerialFrame.Options.model_validate(yaml.safe_load(block)))
    reply = bytes.fromhex("68 0B 0B 68 01 7E 08 AE 47 61 3F 00 00 00 00 1C 16")
    assert poll(device, reply)[0].quality is Quality.DEVICE_ERROR


def test_a_float_in_a_wrong_order_of_bytes_is_no_quiet_zero() -> None:
    device = gauge(
        frame="5A 01 .. .. .. .. CS",
        channels=[{"name": "gap", "at": 2, "type": "float32", "byte_order": "little", "unit": "mm"}],
    )
    (reading,) = poll(device, framed("5A 01 BE 00 00 00"))  # -0.125, high byte first
    assert reading.quality is Quality.MISMATCH
    assert "byte order?" in reading.detail
    (reading,) = poll(device, framed("5A 01 00 00 00 BE"))
    assert reading.value == -0.125


def test_the_fixed_bytes_before_all_others_say_whose_a_reply_is() -> None:
    assert gauge().reply_identity == "\x5a\x01"
    assert gauge(frame=".. 01 .. .. CS").reply_identity is None
