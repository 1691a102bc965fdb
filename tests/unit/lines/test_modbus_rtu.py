"""The RTU master: the CRC, exact lengths, and that nothing damaged or stale ever passes."""

from __future__ import annotations

import itertools
import struct
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from pymodbus.framer.rtu import FramerRTU

from compd.gauge import MAX_SKIPPED_BYTES, LineFault, Quality
from compd.lines.kinds.modbus_rtu.master import RtuMaster, crc16, gap_s
from compd.lines.stream import StreamLine
from tests.support.wire_rig import SETTINGS, InstantClock, ScriptedPort

Device = Callable[[bytes], bytes]
UNIT = 1


def framed(body: bytes) -> bytes:
    return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")


def registers_of(unit: int, function: int, values: list[int]) -> bytes:
    return framed(bytes([unit, function, 2 * len(values)]) + struct.pack(f">{len(values)}H", *values))


def counting_slave(end: int = 100) -> Device:
    """Register i holds i + 1000; the map ends before `end`."""

    def answer(request: bytes) -> bytes:
        unit, function, address, count = struct.unpack(">BBHH", request[:-2])
        if address + count > end:
            return framed(bytes([unit, function | 0x80, 2]))
        return registers_of(unit, function, [i + 1000 for i in range(address, address + count)])

    return answer


def master(device: Device, ask_one_more: bool = True) -> tuple[RtuMaster, ScriptedPort]:
    clock = InstantClock()
    port = ScriptedPort(clock, device=device)
    return RtuMaster(StreamLine(port, 0.1, 0.002, clock), ask_one_more), port


def fault_of(device: Device, count: int = 2) -> LineFault:
    with pytest.raises(LineFault) as caught:
        master(device, ask_one_more=False)[0].read_registers(UNIT, 4, 10, count)
    return caught.value


@pytest.mark.parametrize(
    ("data", "crc"),
    [
        (b"123456789", 0x4B37),  # the check value of CRC-16/MODBUS
        (bytes.fromhex("01030000000A"), 0xCDC5),
        (bytes.fromhex("010400000001"), 0xCA31),
    ],
)
def test_crc_of_known_frames(data: bytes, crc: int) -> None:
    assert crc16(data) == crc


@given(st.binary(max_size=260))
def test_crc_is_the_one_that_pymodbus_computes(data: bytes) -> None:
    assert crc16(data).to_bytes(2, "little") == FramerRTU.compute_CRC(data).to_bytes(2, "big")
    assert crc16(data + crc16(data).to_bytes(2, "little")) == 0


def test_request_on_the_wire() -> None:
    line, port = master(counting_slave(), ask_one_more=False)
    line.read_registers(0x01, 3, 0, 10)
    assert port.written == [bytes.fromhex("01030000000AC5CD")]


@pytest.mark.parametrize("function", [3, 4])
def test_registers_and_time(function: int) -> None:
    line, _ = master(counting_slave())
    for _ in range(3):
        reply = line.read_registers(UNIT, function, 10, 3)
        assert reply.registers == (1010, 1011, 1012)
        assert reply.time_s > 0


def test_every_second_request_asks_for_one_more() -> None:
    line, port = master(counting_slave())
    for _ in range(4):
        line.read_registers(UNIT, 4, 10, 3)
    asked = [struct.unpack(">BBHH", request[:-2])[3] for request in port.written]
    assert sorted(asked) == [3, 3, 4, 4]
    assert asked[0] != asked[1] != asked[2] != asked[3]


def test_a_map_that_ends_there_is_asked_beyond_only_once() -> None:
    line, port = master(counting_slave(end=13))
    for _ in range(6):
        assert line.read_registers(UNIT, 4, 10, 3).registers == (1010, 1011, 1012)
    asked = [struct.unpack(">BBHH", request[:-2])[3] for request in port.written]
    assert asked.count(4) == 1
    assert len(asked) == 7


Beyond = Callable[[bytes], bytes]
BEYOND: dict[str, Beyond] = {
    "silent": lambda request: b"",
    "exception 2": lambda request: framed(bytes([request[0], request[1] | 0x80, 2])),
    "exception 3": lambda request: framed(bytes([request[0], request[1] | 0x80, 3])),
    "exception 4": lambda request: framed(bytes([request[0], request[1] | 0x80, 4])),
    "shorter reply": lambda request: registers_of(request[0], request[1], [1010, 1011, 1012]),
}


def polled(line: RtuMaster, polls: int) -> list[str]:
    """What each of so many polls of three registers gives: "ok" or the fault's quality. Drained as the daemon does."""
    outcomes = []
    for _ in range(polls):
        try:
            assert line.read_registers(UNIT, 4, 10, 3).registers == (1010, 1011, 1012)
            outcomes.append("ok")
        except LineFault as fault:
            outcomes.append(str(fault.quality))
            line.drain()
    return outcomes


@pytest.mark.parametrize("beyond", BEYOND)
def test_whatever_a_slave_does_beyond_its_map_it_does_once(beyond: str) -> None:
    within = counting_slave(end=13)

    def slave(request: bytes) -> bytes:
        _, _, address, count = struct.unpack(">BBHH", request[:-2])
        return BEYOND[beyond](request) if address + count > 13 else within(request)

    line, port = master(slave)
    outcomes = polled(line, 10)
    assert outcomes.count("ok") >= 9, outcomes
    asked = [struct.unpack(">BBHH", request[:-2])[3] for request in port.written]
    assert asked.count(4) == 1


def test_a_slave_that_has_the_register_is_asked_for_it_again_after_a_silence() -> None:
    """Or a cable that was off once would leave the line without the check for the time that it is open."""
    slave = counting_slave()
    off = [False]
    line, port = master(lambda request: b"" if off[0] else slave(request))
    polled(line, 4)
    off[0] = True
    assert set(polled(line, 4)) == {"timeout"}
    off[0] = False
    port.written.clear()
    assert set(polled(line, 6)) == {"ok"}
    assert [struct.unpack(">BBHH", request[:-2])[3] for request in port.written].count(4) == 3


def test_a_slave_that_was_off_at_the_first_longer_request_is_asked_for_it_again() -> None:
    slave = counting_slave()
    off = [False]
    line, port = master(lambda request: b"" if off[0] else slave(request))
    polled(line, 1)
    off[0] = True
    assert polled(line, 2) == ["timeout"] * 2, "the longer request, and the plain one"
    off[0] = False
    port.written.clear()
    assert set(polled(line, 4)) == {"ok"}
    assert [struct.unpack(">BBHH", request[:-2])[3] for request in port.written].count(4) == 2


def test_a_first_longer_reply_that_is_late_says_nothing_about_the_map() -> None:
    slave = counting_slave()
    clock = InstantClock()
    port = ScriptedPort(clock)
    port._device = lambda request: b"" if len(port.written) == 2 else slave(request)
    line = RtuMaster(StreamLine(port, 0.1, 0.002, clock))
    line.read_registers(UNIT, 4, 10, 3)
    with pytest.raises(LineFault, match="timeout"):
        line.read_registers(UNIT, 4, 10, 3)
    port.script = [slave(port.written[-1]), b""]  # comes after all, and is dropped
    assert polled(line, 6) == ["ok"] * 6
    assert [struct.unpack(">BBHH", request[:-2])[3] for request in port.written].count(4) == 4


def test_one_more_is_not_asked_for_where_the_line_says_so() -> None:
    line, port = master(counting_slave(), ask_one_more=False)
    polled(line, 4)
    assert {struct.unpack(">BBHH", request[:-2])[3] for request in port.written} == {3}


def test_blocks_of_different_length_in_turn_need_no_register_more() -> None:
    line, port = master(counting_slave())
    for _ in range(4):
        line.read_registers(UNIT, 4, 10, 3)
        line.read_registers(UNIT, 4, 20, 4)
    asked = [struct.unpack(">BBHH", request[:-2])[3] for request in port.written]
    assert all(count != before for before, count in itertools.pairwise(asked)), "a late reply is one too long"


def test_the_last_register_has_none_beyond_it() -> None:
    line, port = master(lambda request: registers_of(UNIT, 4, [7]))
    for _ in range(2):
        assert line.read_registers(UNIT, 4, 0xFFFF, 1).registers == (7,)
    assert all(struct.unpack(">BBHH", request[:-2])[3] == 1 for request in port.written)


@pytest.mark.parametrize(
    ("code", "name"), [(1, "illegal function"), (2, "illegal data address"), (6, "slave device busy"), (99, "unknown")]
)
def test_exceptions_have_their_names(code: int, name: str) -> None:
    fault = fault_of(lambda request: framed(bytes([UNIT, 0x84, code])))
    assert fault.quality is Quality.DEVICE_ERROR
    assert name in fault.detail


@pytest.mark.parametrize(
    ("answer", "quality"),
    [
        (b"", Quality.TIMEOUT),
        (registers_of(UNIT, 4, [1, 2])[:5], Quality.INCOMPLETE),
        (registers_of(UNIT, 4, [1, 2])[:3], Quality.INCOMPLETE),
        (registers_of(UNIT + 1, 4, [1, 2]), Quality.MISMATCH),
        (registers_of(UNIT, 3, [1, 2]), Quality.MISMATCH),
        (registers_of(UNIT, 4, [1, 2, 3]), Quality.MISMATCH),
        (registers_of(UNIT, 4, [1]), Quality.MISMATCH),
        (framed(bytes([UNIT, 0x83, 2])), Quality.MISMATCH),
        (bytes([UNIT, 0x84, 2, 0, 0]), Quality.CRC),
        (b"\xff" + registers_of(UNIT, 4, [1, 2]), Quality.CRC),
        (bytes.fromhex("01040002"), Quality.INCOMPLETE),
    ],
)
def test_each_fault_has_its_name(answer: bytes, quality: Quality) -> None:
    assert fault_of(lambda request: answer).quality is quality


@given(st.lists(st.integers(0, 0xFFFF), min_size=2, max_size=2), st.integers(0, 8), st.integers(1, 255))
def test_no_damaged_byte_ever_passes(values: list[int], index: int, damage: int) -> None:
    reply = bytearray(registers_of(UNIT, 4, values))
    reply[index] ^= damage
    fault = fault_of(lambda request: bytes(reply))
    assert fault.quality in {Quality.CRC, Quality.INCOMPLETE, Quality.MISMATCH}


def test_a_reply_that_is_one_behind_is_refused() -> None:
    """The device answers each request with the answer to the one before: the classic stale reply."""
    slave = counting_slave()
    behind: list[bytes] = []

    def late(request: bytes) -> bytes:
        behind.append(slave(request))
        return behind[-2] if len(behind) > 1 else b""

    line, _ = master(late)
    qualities = []
    for _ in range(5):
        with pytest.raises(LineFault) as caught:
            line.read_registers(UNIT, 4, 10, 3)
        qualities.append(caught.value.quality)
        line.drain()
    assert qualities[0] is Quality.TIMEOUT
    assert set(qualities[1:]) == {Quality.MISMATCH}


def test_the_silence_before_a_frame() -> None:
    assert gap_s(9600) == pytest.approx(3.5 * 11 / 9600)
    assert gap_s(115200) == 1.75e-3


def behind(damage: bytes, device: Device) -> Device:
    return lambda request: damage + device(request)


@pytest.mark.parametrize("damage", [b"\0", b"\xff", b"\x01", b"\0\xff"])
@pytest.mark.parametrize("count", [1, 2, 3, 32])
@pytest.mark.parametrize("function", [3, 4])
@pytest.mark.parametrize("unit", [UNIT, 5, 6, 15, 16])  # the others are also functions that write
def test_bytes_before_a_reply_are_told_and_can_be_skipped(damage: bytes, count: int, function: int, unit: int) -> None:
    device = behind(damage, counting_slave())
    with pytest.raises(LineFault) as caught:
        master(device, ask_one_more=False)[0].read_registers(unit, function, 10, count)
    bytes_text = "one byte" if len(damage) == 1 else "2 bytes"
    assert f"{bytes_text} before the reply ({damage.hex(' ')}); the rest fits" in caught.value.detail
    assert f"`skip_bytes: {len(damage)}`" in caught.value.detail
    clock = InstantClock()
    port = ScriptedPort(clock, device=device)
    line = RtuMaster(StreamLine(port, 0.1, 0.002, clock), skip_bytes=len(damage))
    for _ in range(4):  # also with one register more
        assert line.read_registers(unit, function, 10, count).registers == tuple(range(1010, 1010 + count))
    assert line.unexpected_bytes == 0


def test_as_many_bytes_are_told_as_a_configuration_may_skip() -> None:
    def line(skip_bytes: int) -> dict[str, object]:
        port = {"kind": "modbus_rtu", "port": "/dev/ttyUSB0", "baud": 9600, "format": "8N1", "timeout_s": 0.1}
        return {**port, "skip_bytes": skip_bytes}

    most = bytes(MAX_SKIPPED_BYTES)
    assert f"`skip_bytes: {len(most)}`" in fault_of(behind(most, counting_slave())).detail
    SETTINGS.validate_python(line(len(most)))
    assert "skip_bytes" not in fault_of(behind(most + b"\0", counting_slave())).detail
    with pytest.raises(ValidationError, match="skip_bytes"):
        SETTINGS.validate_python(line(len(most) + 1))


def test_an_exception_behind_a_byte_is_the_exception() -> None:
    clock = InstantClock()
    port = ScriptedPort(clock, device=behind(b"\0", counting_slave(end=5)))
    with pytest.raises(LineFault, match="illegal data address"):
        RtuMaster(StreamLine(port, 0.1, 0.002, clock), False, 1).read_registers(UNIT, 4, 10, 2)


@pytest.mark.parametrize("damage", [b"\0", b"\0\0\0\0"])
def test_a_damaged_reply_behind_bytes_is_never_believed(damage: bytes) -> None:
    def device(request: bytes) -> bytes:
        reply = bytearray(counting_slave()(request))
        reply[4] ^= 0x10
        return damage + bytes(reply)

    clock = InstantClock()
    line = RtuMaster(StreamLine(ScriptedPort(clock, device=device), 0.1, 0.002, clock), False, 3)
    with pytest.raises(LineFault):
        line.read_registers(UNIT, 4, 10, 2)
