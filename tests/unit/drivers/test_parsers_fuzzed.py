"""Arbitrary bytes to the drivers: readings or a LineFault, and a number only where the protocol has one.

What a reply may look like is written here once more, from the manuals' pages in the drivers' texts and independently of
the drivers; numbers are computed in another way. What follows a whole reply is dropped before the next request.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable
from decimal import Decimal
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from compd.gauge import LineFault, Quality, Reading
from compd.lines import RtuMaster, StreamLine
from compd.lines.kinds.modbus_rtu.master import crc16
from compd.plugins import GAUGES, load
from tests.support.wire_rig import InstantClock, ScriptedPort

bounded = settings(max_examples=200)


def driver(name: str, **options: Any) -> Callable[[], Any]:
    """Makes drivers that remember nothing of each other."""
    kind = load(GAUGES, name, "test")
    checked = kind.Options.model_validate({"driver": name, "line": "line", **options})
    return lambda: kind(checked)


def outcome(gauge: Any, reply: bytes) -> list[Reading] | LineFault:
    """What one poll gives when `reply` comes to every request, in one piece."""
    clock = InstantClock()
    line: Any = StreamLine(ScriptedPort(clock, device=lambda request: reply), 0.1, 0.002, clock)
    if gauge.line_kind == "registers":
        line = RtuMaster(line, ask_one_more=False)
    try:
        readings = list(gauge.read(line))
    except LineFault as fault:
        return fault
    assert len(readings) == len(gauge.channels)
    for reading in readings:
        assert isinstance(reading, Reading)
        assert isinstance(reading.quality, Quality)
        assert math.isfinite(reading.value) == reading.ok
    return readings


def mutated(replies: list[bytes]) -> st.SearchStrategy[bytes]:
    """Arbitrary bytes, and whole replies with a few bytes replaced, removed or put in."""
    alphabet = st.sampled_from(
        sorted({bytes([byte]) for reply in replies for byte in reply} | {b"\x00", b" ", b"9", b"-"})
    )
    byte = alphabet | st.binary(min_size=1, max_size=1)

    def changed(reply: bytes, changes: list[tuple[float, int, bytes]]) -> bytes:
        for share, length, data in changes:
            place = round(share * len(reply))
            reply = reply[:place] + data + reply[place + length :]
        return reply

    change = st.tuples(st.floats(0, 1), st.integers(0, 2), byte | st.just(b""))
    return (
        st.builds(changed, st.sampled_from(replies), st.lists(change, max_size=3))
        | st.lists(alphabet, max_size=40).map(b"".join)
        | st.binary(max_size=40)
    )


def number(text: bytes) -> float:
    """By way of decimal arithmetic, blanks dropped."""
    return float(Decimal(text.replace(b" ", b"").decode("ascii")))


def check(make: Callable[[], Any], reply: bytes, values: Callable[[bytes], list[float | None] | None]) -> None:
    """`values`: what the protocol has for the reply: a number per channel, None for a channel or reply without any."""
    expected = values(reply)
    readings = outcome(make(), reply)
    if isinstance(readings, LineFault):
        return
    for index, reading in enumerate(readings):
        if reading.ok:
            assert expected is not None, f"{reply!r} gave {reading.value}"
            wanted = expected[index]
            assert wanted is not None, f"{reply!r} gave {reading.value}"
            assert reading.value == pytest.approx(wanted, rel=1e-9, abs=1e-12)


ND28X = [b"+    12.345    \r\n", b"-     0.001   A\r\n", b'+   1.23456 "  \r\n', b"+    12.345 ?  \r\n"]


nd28x = driver("heidenhain_nd28x")


@bounded
@given(mutated(ND28X))
def test_nd28x(reply: bytes) -> None:
    def values(reply: bytes) -> list[float | None] | None:
        match = re.fullmatch(rb"([+ -])( *[0-9]*\.[0-9]+) ( )[<>=? ][ A]\r\n", reply[:17])
        if match is None or len(reply) < 17:
            return None
        return [number(match[2]) * (-1 if match[1] == b"-" else 1)]

    check(nd28x, reply, values)


DLRS1A = [b"M0,+000.1234,-001.2345,+199.9990\r\n", b"M0,-------,+000.0001,+012.0000\r\n", b"ER,M0,01\r\n"]


dlrs1a = driver("keyence_gt2_dlrs1a", heads=3)


@bounded
@given(mutated(DLRS1A))
def test_keyence_dlrs1a(reply: bytes) -> None:
    def values(reply: bytes) -> list[float | None] | None:
        line, end, _ = reply.partition(b"\r\n")
        fields = line.split(b",")
        if not end or fields[0] != b"M0" or len(fields) != 4:
            return None
        return [number(field) if re.fullmatch(rb"[+-][0-9]{3}\.[0-9]{4}", field) else None for field in fields[1:]]

    check(dlrs1a, reply, values)


DLEN1 = [b"MS,04,+000012345,00,-000012345\r\n", b"MS,03,+000012345,00,+099999999\r\n", b"ER,MS,031\r\n"]


dlen1 = driver("keyence_dlen1", heads=2, decimals=4)


@bounded
@given(mutated(DLEN1))
def test_keyence_dlen1(reply: bytes) -> None:
    def values(reply: bytes) -> list[float | None] | None:
        match = re.fullmatch(rb"MS,([0-9]{2}),([+-][0-9]{9}),([0-9]{2}),([+-][0-9]{9})\r\n(?s:.*)", reply)
        if match is None:
            return None
        pairs = [(match[1], match[2]), (match[3], match[4])]
        return [
            None if state == b"03" or abs(int(digits)) > 99_999_997 else number(digits) / 10_000
            for state, digits in pairs
        ]

    check(dlen1, reply, values)


MAHR = [
    b"1 +0012.3 um;2 ERR6;3 -0001.5 um = <\r",
    b"1 +0012.3 um <;2 +0000.1 um;3 ERR1\r",
    b"1 +0012.3 mm;2 ERR6;3 ERR6\r",
]


c1202 = driver("mahr_c1202", features=[1, 3], unit="um", digits=4, decimals=1)


@bounded
@given(mutated(MAHR))
def test_mahr_c1202(reply: bytes) -> None:
    def values(reply: bytes) -> list[float | None] | None:
        line, end, _ = reply.partition(b"\r")
        features = line.split(b";")
        if not end or len(features) != 3:
            return None
        numbers: list[float | None] = []
        for index, feature in enumerate(features, start=1):
            match = re.fullmatch(rb" *%d ([+-][0-9]{4}\.[0-9]) um(?: [<=>]){0,2} *" % index, feature)
            numbers.append(number(match[1]) / 1000 if match else None)
        return [numbers[0], numbers[2]]

    check(c1202, reply, values)


ASCII = [b"M,+012.3456,   12.50\r\n", b"M,-000.0001,   ERROR\r\n", b"M,+999.9999,    0.00\r\n", b"ER12\r\n"]


described_ascii = driver(
    "serial_ascii",
    out="M",
    out_terminator=r"\r\n",
    in_terminator=r"\r\n",
    channels=[{"name": "a", "unit": "mm"}, {"name": "b", "unit": "um", "instead": {"   ERROR": "sensor_fault"}}],
    errors=[{"in": "ER%*2[0-9]", "quality": "device_error"}, {"in": "M,+999.9999,%*8c", "quality": "over_range"}],
    **{"in": "M,%(a)+09.4f,%(b)8.2f"},
)


@pytest.mark.long
@bounded
@given(mutated(ASCII))
@example(b"M,+999.9999,    0.00\r\n")
def test_serial_ascii(reply: bytes) -> None:
    def values(reply: bytes) -> list[float | None] | None:
        match = re.fullmatch(rb"M,([+-][0-9]{3}\.[0-9]{4}|[+-] +[0-9]*\.[0-9]{4}),(.{8})\r\n", reply, re.DOTALL)
        if match is None or len(match[1]) != 9 or reply.startswith(b"M,+999.9999"):
            return loose(reply)
        plain = re.fullmatch(rb" *[+-]? *[0-9]*\.[0-9]{2}", match[2])
        return [number(match[1]), number(match[2]) / 1000 if plain else None]

    def loose(reply: bytes) -> list[float | None] | None:
        """Blanks in place of leading zeros, before the sign too."""
        match = re.fullmatch(rb"M,( *[+-] *[0-9]*\.[0-9]{4}),( *[+-]? *[0-9]*\.[0-9]{2}|   ERROR)\r\n", reply)
        if match is None or len(match[1]) != 9 or len(match[2]) != 8 or reply.startswith(b"M,+999.9999"):
            return None
        return [number(match[1]), None if b"E" in match[2] else number(match[2]) / 1000]

    check(described_ascii, reply, values)


SIGN_BEHIND = [b"0012.300-mm*51\r\n", b"0500.000+um*56\r\n", b"0000.001 mm*33\r\n"]


sign_behind = driver(
    "serial_ascii",
    out="?",
    in_terminator=r"\r\n",
    channels=[{"name": "a", "unit": "mm"}],
    **{"in": r"%08.3f%{+=1|-=-1| =1}%{mm=1|um=0.001}*%#.1<sum100>"},
)


@bounded
@given(mutated(SIGN_BEHIND))
@example(b"-012.300-mm*48\r\n")
def test_a_sign_behind_a_unit_by_table_and_a_decimal_sum(reply: bytes) -> None:
    def values(reply: bytes) -> list[float | None] | None:
        match = re.fullmatch(rb"( *[0-9]*\.[0-9]{3})([+ -])(mm|um)\*([0-9]{2})\r\n", reply)
        if match is None or len(match[1]) != 8 or sum(reply[:-5]) % 100 != int(match[4]):
            return None
        return [number(match[1]) * (-1 if match[2] == b"-" else 1) * (1e-3 if match[3] == b"um" else 1)]

    check(sign_behind, reply, values)


def framed(data: bytes) -> bytes:
    return data + bytes([sum(data) % 256])


FRAME = [framed(b"\x5a\x01" + struct.pack(">hf", *pair)) for pair in ((-200, 1.5), (7, -1e-3), (32767, 0.0))]


described_frame = driver(
    "serial_frame",
    out="A5 01",
    frame="5A 01 .. .. .. .. .. .. CS",
    checksum={"kind": "sum8"},
    channels=[
        {
            "name": "a",
            "at": 2,
            "type": "int16",
            "byte_order": "big",
            "unit": "um",
            "invalid": {32767: "sensor_fault"},
        },
        {"name": "b", "at": 4, "type": "float32", "byte_order": "big", "unit": "mm"},
    ],
)


@bounded
@given(mutated(FRAME) | st.binary(min_size=6, max_size=6).map(lambda data: framed(b"\x5a\x01" + data)))
@example(framed(b"\x5a\x01\x00\x07\x00\x00\x80\x3f"))
def test_serial_frame(reply: bytes) -> None:
    def values(reply: bytes) -> list[float | None] | None:
        if len(reply) != 9 or reply[:2] != b"\x5a\x01" or sum(reply[:8]) % 256 != reply[8]:
            return None
        whole, real = struct.unpack_from(">hf", reply, 2)
        plausible = math.isfinite(real) and (real == 0 or 1e-20 <= abs(real) <= 1e20)
        return [None if whole == 32767 else whole / 1000, real if plausible else None]

    check(described_frame, reply, values)


def rtu(data: bytes) -> bytes:
    return data + crc16(data).to_bytes(2, "little")


RTU = [rtu(b"\x05\x04\x06" + struct.pack(">hf", *pair)) for pair in ((-200, 1.5), (7, -1e-3))] + [rtu(b"\x05\x84\x02")]


registers = driver(
    "modbus",
    unit=5,
    channels=[
        {"name": "a", "function": 4, "address": 0, "type": "int16", "scale": 1e-4, "unit": "mm"},
        {"name": "b", "function": 4, "address": 1, "type": "float32", "unit": "mm"},
    ],
)


@bounded
@given(mutated(RTU) | st.binary(min_size=6, max_size=6).map(lambda data: rtu(b"\x05\x04\x06" + data)))
def test_modbus_frames(reply: bytes) -> None:
    def values(reply: bytes) -> list[float | None] | None:
        if len(reply) < 11 or reply[:3] != b"\x05\x04\x06" or crc16(reply[:11]) != 0:
            return None
        whole, real = struct.unpack_from(">hf", reply, 3)
        plausible = math.isfinite(real) and (real == 0 or 1e-20 <= abs(real) <= 1e20)
        return [whole * 1e-4, real if plausible else None]

    check(registers, reply, values)


@pytest.mark.parametrize(
    ("make", "reply"),
    [
        (nd28x, ND28X[0]),
        (dlrs1a, DLRS1A[0]),
        (dlen1, DLEN1[0]),
        (c1202, b"1 +0012.3 um;2 ERR6;3 -0001.5 um = <\r"),
        (described_ascii, ASCII[0]),
        *((sign_behind, reply) for reply in SIGN_BEHIND),
        (described_frame, FRAME[0]),
        (registers, RTU[0]),
    ],
)
def test_what_is_mutated_is_a_reply_with_numbers(make: Callable[[], Any], reply: bytes) -> None:
    readings = outcome(make(), reply)
    assert not isinstance(readings, LineFault)
    assert readings[0].ok
