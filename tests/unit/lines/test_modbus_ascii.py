"""Modbus ASCII: frames of digits, the LRC, exact lengths, and that nothing damaged or stale ever passes."""

from __future__ import annotations

import struct
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer.ascii import FramerAscii

from compd.gauge import LineFault, Quality
from compd.lines.kinds.modbus_ascii.master import AsciiMaster, lrc
from compd.lines.stream import StreamLine
from tests.support.wire_rig import InstantClock, ScriptedPort

UNIT = 1


def framed(body: bytes) -> bytes:
    return b":" + (body + bytes([FramerAscii.compute_LRC(body)])).hex().upper().encode() + b"\r\n"


def registers_of(values: list[int], unit: int = UNIT, function: int = 4) -> bytes:
    return framed(bytes([unit, function, 2 * len(values)]) + struct.pack(f">{len(values)}H", *values))


def master(device: Callable[[bytes], bytes]) -> tuple[AsciiMaster, ScriptedPort]:
    clock = InstantClock()
    port = ScriptedPort(clock, device=device)
    return AsciiMaster(StreamLine(port, 0.1, 0.002, clock)), port


def test_the_frame_on_the_wire() -> None:
    """Its LRC by hand: 06 + 03 + 6B + 03 = 77, and 100 - 77 = 89, hexadecimal."""
    line, port = master(lambda request: registers_of([0] * 3, unit=6, function=3))
    line.read_registers(6, 3, 0x6B, 3)
    assert port.written == [b":0603006B000389\r\n"]


@given(st.binary(max_size=250))
def test_the_lrc_is_the_one_that_pymodbus_computes(data: bytes) -> None:
    assert lrc(data) == FramerAscii.compute_LRC(data)


def test_registers_bits_and_writes() -> None:
    line, port = master(lambda request: registers_of([7, 0xFFFF]))
    assert line.read_registers(UNIT, 4, 10, 2).registers == (7, 0xFFFF)
    line, port = master(lambda request: framed(bytes([UNIT, 2, 1, 0b101])))
    assert line.read_bits(UNIT, 2, 0, 3).registers == (1, 0, 1)
    line, port = master(lambda request: request)
    line.write(UNIT, 6, 40, [5])
    assert port.written == [framed(bytes([UNIT, 6, 0, 40, 0, 5]))]
    line, port = master(lambda request: framed(bytes([UNIT, 16, 0, 40, 0, 2])))
    line.write(UNIT, 16, 40, [5, 6])
    line, port = master(lambda request: b"")
    line.write(0, 5, 3, [1], settle_s=0.1)
    assert port.written == [framed(bytes([0, 5, 0, 3, 0xFF, 0]))]


def fault_of(answer: bytes) -> LineFault:
    with pytest.raises(LineFault) as caught:
        master(lambda request: answer)[0].read_registers(UNIT, 4, 10, 2)
    return caught.value


@pytest.mark.parametrize(
    ("answer", "quality"),
    [
        (b"", Quality.TIMEOUT),
        (registers_of([1, 2])[:8], Quality.INCOMPLETE),
        (registers_of([1, 2])[:11], Quality.INCOMPLETE),
        (registers_of([1, 2], unit=2), Quality.MISMATCH),
        (registers_of([1, 2], function=3), Quality.MISMATCH),
        (registers_of([1, 2, 3]), Quality.MISMATCH),
        (registers_of([1]), Quality.MISMATCH),
        (b"\xff" + registers_of([1, 2]), Quality.MISMATCH),
        (registers_of([1, 2]).replace(b"01", b"0G", 1), Quality.CRC),
        (registers_of([1, 2]).replace(b"0001", b"0003"), Quality.CRC),
        (registers_of([1, 2])[:-2] + b"  ", Quality.MISMATCH),
        (framed(bytes([UNIT, 0x84, 2])), Quality.DEVICE_ERROR),
    ],
)
def test_each_fault_has_its_name(answer: bytes, quality: Quality) -> None:
    assert fault_of(answer).quality is quality


@given(st.lists(st.integers(0, 0xFFFF), min_size=2, max_size=2), st.integers(0, 18), st.integers(1, 255))
def test_no_damaged_byte_ever_passes(values: list[int], index: int, damage: int) -> None:
    reply = bytearray(registers_of(values))
    reply[index] ^= damage
    if bytes(reply).upper() == registers_of(values):
        return  # a hexadecimal digit in lower case is the same digit
    assert fault_of(bytes(reply)).quality in {Quality.CRC, Quality.INCOMPLETE, Quality.MISMATCH}


def test_every_second_request_asks_for_one_more_here_too() -> None:
    def slave(request: bytes) -> bytes:
        count = int(request[9:13], 16)
        return registers_of(list(range(count)))

    line, port = master(slave)
    for _ in range(4):
        assert line.read_registers(UNIT, 4, 10, 3).registers == (0, 1, 2)
    assert [int(request[9:13], 16) for request in port.written] == [3, 4, 3, 4]
