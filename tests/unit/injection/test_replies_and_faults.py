"""What the injector changes is the number alone: frames stay whole, and their checksums fit."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest

from tests.injection.faults import (
    Exchange,
    Fault,
    Late,
    Lost,
    Off,
    OneDigit,
    OneReplyLate,
    Sent,
    Shorter,
    Shows,
    Stuck,
)
from tests.injection.line_faults import FaultOfLine, sent_through
from tests.injection.replies import Display, HeadsUnit, Protocol, Registers, crc16
from tests.injection.signal_faults import Coarse, Hum, Noisy, Scaled, Steps

FLOATS = [
    {"name": "u1", "address": 0, "type": "float32"},
    {"name": "room", "address": 2, "type": "int16", "scale": 0.01},
]
DISPLAY = (Display(), b"\x02", b"-    1.2345    \r\n")
HEADS = (HeadsUnit(2), b"M0\r\n", b"M0,+000.0120,-001.5000\r\n")
RTU_BODY = b"\x01\x04\x06" + struct.pack(">fh", 0.25, 2015)
RTU = (Registers(FLOATS, over_tcp=False), b"\x01\x04\x00\x00\x00\x03\xb0\x0b", RTU_BODY + crc16(RTU_BODY))
TCP = (
    Registers(FLOATS, over_tcp=True),
    b"\x00\x07\x00\x00\x00\x06\x01\x04\x00\x00\x00\x03",
    b"\x00\x07\x00\x00\x00\x09\x01\x04\x06" + struct.pack(">fh", 0.25, 2015),
)
LINES = pytest.mark.parametrize(("protocol", "request_", "reply"), [DISPLAY, HEADS, RTU, TCP])


def sent(fault: Fault, line: tuple[Protocol, bytes, bytes], number: int = 0, elapsed_s: float = 0.0) -> list[bytes]:
    protocol, request, reply = line
    return [s.data for s in fault.send(Exchange(protocol, request, reply, number, elapsed_s))]


def test_the_crc_is_that_of_the_specification() -> None:
    assert crc16(bytes.fromhex("01030000000a")) == bytes.fromhex("c5cd")


@LINES
def test_a_reply_is_whole_once_and_keeps_its_bytes_where_no_number_changes(
    protocol: Protocol, request_: bytes, reply: bytes
) -> None:
    assert protocol.request_length(request_ + b"\x02") == len(request_)
    assert [n for n in range(len(reply) + 1) if protocol.reply_length(reply[:n])] == [len(reply)]
    values = protocol.values(request_, reply)
    assert set(values) == set(protocol.channels)
    assert protocol.with_values(request_, reply, values) == reply


@LINES
def test_a_number_that_is_off_comes_in_a_frame_that_fits(protocol: Protocol, request_: bytes, reply: bytes) -> None:
    first = protocol.channels[0]
    (changed,) = sent(Off((first,), by=0.5), (protocol, request_, reply))
    before, after = protocol.values(request_, reply), protocol.values(request_, changed)
    assert after[first] - before.pop(first) == pytest.approx(0.5)
    assert before.items() <= after.items()
    assert len(changed) == len(reply)
    if protocol is RTU[0]:
        assert crc16(changed[:-2]) == changed[-2:]


def test_a_drift_grows_and_one_reading_is_one() -> None:
    drift = Off(("position",), drift_per_s=0.01)
    assert sent(drift, DISPLAY, 5, elapsed_s=2.0) == [b"-    1.2145    \r\n"]
    once = Off(("position",), by=1.0, count=1)
    assert sent(once, DISPLAY, 0) != [DISPLAY[2]]
    assert sent(once, DISPLAY, 1) == [DISPLAY[2]]


def test_one_digit_is_another_one() -> None:
    assert sent(OneDigit("position", -1), DISPLAY) == [b"-    1.7345    \r\n"]


def test_what_is_stuck_shows_its_first_number_and_what_is_behind_the_one_before() -> None:
    other = (DISPLAY[0], DISPLAY[1], b"+    9.0000    \r\n")
    stuck, behind = Stuck(), OneReplyLate()
    assert [sent(stuck, line) for line in (DISPLAY, other)] == [[DISPLAY[2]], [DISPLAY[2]]]
    assert [sent(behind, line) for line in (DISPLAY, other)] == [[], [DISPLAY[2]]]


def test_a_register_may_hold_nan() -> None:
    (changed,) = sent(Shows(("u1",), math.nan), TCP)
    values = TCP[0].values(TCP[1], changed)
    assert math.isnan(values["u1"])
    assert values["room"] == pytest.approx(20.15)
    assert sent(Lost(count=1), TCP) == []


def through(faults: list[Fault], line: tuple[Protocol, bytes, bytes]) -> list[Sent]:
    protocol, request, reply = line
    return sent_through([FaultOfLine(fault, 10.0) for fault in faults], Exchange(protocol, request, reply), 12.0)


def test_faults_of_one_line_come_together_and_numbers_are_changed_before_bytes() -> None:
    drift, jump = Off(("position",), drift_per_s=0.01), Off(("position",), by=1.0)
    short, late, later = Shorter(), Late(0.2), Late(0.1)
    (sent,) = through([short, late, drift, later, jump], DISPLAY)
    assert sent == Sent(b"-    0.2145    \r", delay_s=pytest.approx(0.3))
    assert through([jump, Lost(count=1), drift], DISPLAY) == []
    assert through([], DISPLAY) == [Sent(DISPLAY[2])]


@pytest.mark.parametrize(
    ("fault", "shown_mm"),
    [
        (Scaled(("position",), -1.0), 1.2345),
        (Scaled(("position",), 1 / 25.4), -0.0486),
        (Scaled(("position",), per_s=0.05), -1.3580),
        (Steps(("position",), 0.02, every_s=0.75, count=10), -1.1745),
        (Steps(("position",), 0.02, every_s=0.75, count=2), -1.1945),
        (Hum(("position",), 0.02, hz=0.125), -1.2145),
        (Coarse(("position",), 0.01), -1.23),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_becomes_of_a_signal_after_two_seconds(fault: Fault, shown_mm: float) -> None:
    (reply,) = through([fault], DISPLAY)
    assert DISPLAY[0].values(DISPLAY[1], reply.data) == {"position": pytest.approx(shown_mm, abs=1e-4)}


def test_noise_has_its_deviation_and_follows_from_the_seed() -> None:
    def shown(seed: int) -> list[float]:
        fault = Noisy(("position",), 0.005, seed)
        return [DISPLAY[0].values(b"", sent(fault, DISPLAY)[0])["position"] for _ in range(400)]

    assert shown(1) == shown(1) != shown(2)
    assert np.std(shown(1)) == pytest.approx(0.005, rel=0.1)
    assert np.mean(shown(1)) == pytest.approx(-1.2345, abs=0.001)
