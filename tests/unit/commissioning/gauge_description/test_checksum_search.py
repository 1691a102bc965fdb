"""Checksums at the end of replies: each kind that compd knows is found, and none where there is none.

The checksums are computed here in another way than compd computes them.
"""

from __future__ import annotations

import binascii
import functools
import operator
import random

import pytest

from compd.gauge_description import Answers, learn_gauge
from compd.gauge_description.capture import CapturedReply
from compd.gauge_description.observed_exchange import checksum_end

NUMBERS = [b"+012.300", b"-002.310", b"+000.001", b"-101.750"]


def xor(data: bytes) -> int:
    return functools.reduce(operator.xor, data)


REPLIES = {
    "STX, ETX, BCC": ([b"\x02" + n + b"\x03" + bytes([xor(n + b"\x03")]) for n in NUMBERS], "%1<xor8>"),
    "NMEA": ([b"$GAUGE," + n + b"*%02X" % xor(b"GAUGE," + n) for n in NUMBERS], "%01.1<xor8>"),
    "sum in hexadecimal digits": ([b"#01" + n + b"%02X" % (sum(b"#01" + n) & 255) for n in NUMBERS], "%0<sum8>"),
    "in small letters": ([b"#01" + n + b"%02x" % (sum(b"#01" + n) & 255) for n in NUMBERS], "%0<sum8>"),
    "sum to 0": ([n + bytes([-sum(n) & 255]) for n in NUMBERS], "%<negative_sum8>"),
    "two decimal digits": ([n + b"%02d" % (sum(n) % 100) for n in NUMBERS], "%#<sum100>"),
    "three decimal digits": ([n + b"%03d" % (sum(n) % 256) for n in NUMBERS], "%#<sum8>"),
    "XMODEM": ([n + binascii.crc_hqx(n, 0).to_bytes(2, "big") for n in NUMBERS], "%<crc_xmodem>"),
    "CCITT in digits": ([n + b"%04X" % binascii.crc_hqx(n, 0xFFFF) for n in NUMBERS], "%0<crc_ccitt>"),
    "a sum without STX and ETX": ([b"\x02" + n + b"\x03%02X" % (sum(n) & 255) for n in NUMBERS], "%01.1<sum8>"),
}


@pytest.mark.parametrize("case", REPLIES)
def test_each_checksum_is_found_where_it_ends_the_replies(case: str) -> None:
    bodies, converter = REPLIES[case]
    found = checksum_end(bodies)
    assert found is not None
    assert found.converter == converter


@pytest.mark.parametrize("terminator", [b"\r", b"\x03", b"\r\n", b""])
@pytest.mark.parametrize("case", REPLIES)
def test_a_learned_checksum_is_checked(case: str, terminator: bytes) -> None:
    bodies, converter = REPLIES[case]
    captured = [CapturedReply(b"?\r", body + terminator) for body in bodies]
    description, values = learn_gauge(captured, Answers(units=("mm",), ranges=("unknown",)))
    assert description.options["in"].endswith(converter)
    assert [float(value) for value in values] == [float(number) for number in NUMBERS]


def test_digits_of_a_number_are_no_checksum() -> None:
    """Of replies whose last digits are measured; seeded, so that a chance is the same in every run."""
    source = random.Random(1)
    for _ in range(50):
        numbers = [b"%+.4f" % source.uniform(-10, 10) for _ in range(4)]
        assert checksum_end(numbers) is None


def test_what_never_changes_is_no_checksum() -> None:
    assert checksum_end([b"+1.23000", b"+1.24000", b"+1.25000", b"+1.26000"]) is None
