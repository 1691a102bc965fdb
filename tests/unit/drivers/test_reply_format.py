"""Reply formats: what they read, what must never pass, and their checksums, signs and units."""

from __future__ import annotations

import binascii
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compd.gauge import Quality
from compd.lines import CHECKSUMS
from compd_drivers.reply_format import ReplyFormat
from compd_drivers.simulated.serial_ascii import SimulatedAscii
from tests.support.ascii_gauge import CHANNEL, fault, gauge, poll


@pytest.mark.parametrize(
    ("form", "reply", "value"),
    [
        ("%f", b"+12.345", 12.345),
        ("%f", b"-.5", -0.5),
        ("%f", b"   1.0", 1.0),
        ("%+09.4f", b"+012.3456", 12.3456),
        ("%+9.4f", b"+ 12.3456", 12.3456),
        ("%+9.4f", b"  -2.3456", -2.3456),
        ("% .3f", b" 12.345", 12.345),
        ("%d", b"0012", 12.0),
        ("%+06d", b"-00012", -12.0),
        ("%4x", b"00fF", 255.0),
        ("%+4x", b"FFFF", -1.0),
        ("%+4x", b"8000", -32768.0),
        ("%+4x", b"7fff", 32767.0),
        ("%+08.3f%*2c", b"+001.23041", 1.23),  # a glued checksum
        ("%+08.3f%*2[0-9A-F]", b"-012.300A7", -12.3),
        (":010402%+4x%*2c", b":010402FB2E2A", -1234.0),  # Modbus ASCII
        ("%+2x", b"FE", -2.0),
        ("%{+=1|-=-1}%4x", b"-00FF", -255.0),  # signed hexadecimal with the sign as a character
        ("%e", b"+1.2345E-03", 0.0012345),
        ("%e", b"1E-3", 0.001),
        ("%e", b"-2E+1", -20.0),
        ("%.0e", b"1E-3", 0.001),
        ("%+.4e", b"-1.2345E-03", -0.0012345),
        ("%f %{mm=1|um=0.001}", b"+1.5 mm", 1.5),
        ("%f %{mm=1|um=0.001}", b"+1500.0 um", 1.5),
        ("%+08.3f%{mm=1|um=0.001}", b"-500.000um", -0.5),
        ("%{mm=1|um=0.001} %f", b"um 1500.0", 1.5),
        ("%{m=1000|mm=1}%f", b"mm1.5", 1.5),
        ("%8.3f%{+=1|-=-1}", b"  12.300-", -12.3),  # the sign behind the digits
        ("%f%{-=-1|=1}", b"12.3", 12.3),
        ("%f%{-=-1|=1}", b"12.3-", -12.3),
        ("%{L=-1|R=1}%08.3f", b"L0012.300", -12.3),
        ("%{-=-1| =1}%07.3f%{mm=1|um=0.001}", b"-500.000um", -0.5),
        ("%*[^,],%f", b"x" * 200 + b",1.5", 1.5),
        ("%*40c%f", b"x" * 40 + b"1.5", 1.5),
        ("$PX,%f*%01.1<xor8>", b"$PX,1.5*0E", 1.5),
        (r"\x02%f\x03", b"\x021.5\x03", 1.5),
        ("100%%=%d", b"100%=7", 7.0),
        ("%*5c%f", b"N0 : 1.5", 1.5),
        ("%*4c%f", b"N0 :-1.5", -1.5),
        ("%*2c%+f", b"01+1.5", 1.5),
        ("%*s %f mm", b"GN01 1.5 mm", 1.5),
        ("%f mm%*?[<>= ]", b"1.5 mm = <", 1.5),
        ("%f mm%*?[<>= ]", b"1.5 mm", 1.5),
        ("%f%*[<>=]", b"1.5>", 1.5),
    ],
)
def test_formats_read_what_a_printf_prints(form: str, reply: bytes, value: float) -> None:
    assert ReplyFormat(form).match(reply) == (pytest.approx(value),)


@pytest.mark.parametrize(
    ("form", "reply"),
    [
        ("%f", b"12"),  # the point lost
        ("%f", b"1.2.3"),
        ("%f", b"1.5 "),
        ("%f", b"+-1.5"),
        ("%f", b"1,5"),
        ("%f", b"nan"),
        ("%e", b"1.E-3"),
        ("%.0e", b"1.0E-3"),
        ("%f %{mm=1|um=0.001}", b"1.5 nm"),
        ("%f %{mm=1|um=0.001}", b"1.5 "),
        ("%f%{+=1|-=-1}", b"-12.3-"),  # two signs
        ("%f%{+=1|-=-1}", b"+12.3-"),
        ("%f%{+=1|-=-1}", b"12.3"),
        ("$PX,%f*%01.1<xor8>", b"$PX,1.5*0F"),
        ("$PX,%f*%01.1<xor8>", b"$PX,1.6*0E"),
        ("%f", b"1e5"),
        ("%+f", b"1.5"),  # the sign lost
        ("% f", b"1.5"),
        ("%+09.4f", b"+12.3456"),  # a digit lost
        ("%+09.4f", b"+0123.456"),  # the point moved
        ("%+09.4f", b"+0012.3456"),
        ("%d", b"1.5"),
        ("%f%*s", b"1.234"),  # what is skipped must not be a digit of the number
        ("%f%*c", b"1.234"),
        ("%8f%*s", b"+112.3456"),
        ("%+08.3f%*2c", b"+001.2304"),  # a digit lost
        ("%+08.3f%*2c", b"+01.23041"),
        ("%+f%*2c", b"+001.23041"),  # a number of open width would take what is to be skipped
        ("%+4x", b"FFF"),
        ("%*5c%f", b"N0 :-1.5"),
        ("%*4c%f", b"N0 :1.5"[:3] + b"11.5"),
        ("%*s%f", b"x+-1.5"),
        ("%f mm", b"1.5 in"),
        ("%*2[0-9],%f", b"7,1.5"),
    ],
)
def test_formats_refuse_everything_else(form: str, reply: bytes) -> None:
    assert ReplyFormat(form).match(reply) is None


@given(st.integers(-999_9999, 999_9999), st.integers(0, 8))
def test_a_lost_byte_never_gives_another_number_where_the_width_is_given(steps: int, lost: int) -> None:
    form = ReplyFormat("%+09.4f")
    reply = f"{steps / 1e4:+09.4f}".encode()
    assert form.match(reply) == (pytest.approx(steps / 1e4),)
    assert form.match(reply[:lost] + reply[lost + 1 :]) is None


@pytest.mark.parametrize(
    "form",
    [
        *("%q", "%s", "%.0f", "%(a)f%(a)f", "%*[]", "50%", "%<foo>", r"\q", "\\", "\u20ac", "%?f", "%*+d"),
        *("%f%{mm}", "%f%{mm=}", "%f%{mm=0}", "%f%{mm=x}", "%f%{mm=inf}", "%f%{mm=1|mm=2}", "%f%{m2=1}", "%{mm=1}"),
        *("%(a)f%(b){mm=1}", "%f%*{mm=1}", "%f%4{mm=1}", "%+x"),
    ],
)
def test_a_format_that_cannot_be_read_is_refused(form: str) -> None:
    with pytest.raises(ValueError, match=r".+"):
        ReplyFormat(form)


@pytest.mark.parametrize(
    ("form", "reply", "value"),
    [
        ("%f", b"+0001,230", 1.23),
        ("%+09.3f", b"+0001,230", 1.23),
        ("%e", b"1,5E-3", 0.0015),
        ("%f;%(b)f", b"1,5;2,5", 1.5),
    ],
)
def test_a_decimal_comma(form: str, reply: bytes, value: float) -> None:
    values = ReplyFormat(form, mark=",").match(reply)
    assert values is not None
    assert values[0] == pytest.approx(value)
    assert ReplyFormat(form, mark=",").match(reply.replace(b",", b".")) is None
    assert ReplyFormat(form).match(reply) is None


def test_numbers_with_commas_between_them_and_in_them_are_no_numbers() -> None:
    assert ReplyFormat("%(a)f,%(b)f", mark=",").match(b"1,5,2,5") is None


@pytest.mark.parametrize(
    ("kind", "check"),
    [
        ("sum8", 0xDD), ("xor8", 0x31), ("crc8", 0xF4), ("crc16_modbus", 0x4B37), ("crc_ccitt", 0x29B1),
        ("crc_xmodem", 0x31C3), ("sum16", 0x01DD), ("sum100", 77),
    ],
)  # fmt: skip
def test_checksums_have_their_published_check_values(kind: Any, check: int) -> None:
    """Of the digits 1 to 9, as the catalogue of parametrised CRC algorithms gives them."""
    assert CHECKSUMS[kind].value(b"123456789") == check


@pytest.mark.parametrize(
    ("form", "reply"),
    [
        (r"%+08.3f%#<sum100>", b"+001.23083"),
        (r"%+08.3f%#<sum8>", b"+001.230127"),
        (r"\x02%+08.3f%#1<sum16>\x03", b"\x02+001.23000383\x03"),
        (r"%+08.3f%<crc_xmodem>", b"+001.230" + binascii.crc_hqx(b"+001.230", 0).to_bytes(2, "big")),
        (r"%+08.3f%0<crc_ccitt>", b"+001.230" + f"{binascii.crc_hqx(b'+001.230', 0xFFFF):04X}".encode()),
        (r":010402%+4x%01<modbus_lrc>", b":010402FB2ED0"),
    ],
)
def test_checksums_in_digits_of_every_kind(form: str, reply: bytes) -> None:
    made = ReplyFormat(form)
    assert made.match(reply) is not None
    assert made.length == len(reply)
    damaged = bytearray(reply)
    damaged[8] ^= 1
    assert made.match(bytes(damaged)) is None
    assert made.checksum_fails(bytes(damaged))


SIGNED_UNITS = {
    "sign behind": {"in": "%08.3f%{+=1|-=-1}"},
    "unit by table": {"in": "%+09.4f%{mm=1|um=0.001}"},
    "both": {"in": "%{L=-1|R=1}%08.3f %{um=0.001|mm=1}"},
    "decimal comma": {"in": "%+09.4f", "decimal_mark": ","},
    "exponent": {"in": "%.0e"},
    "NMEA": {"in": "$PX,%+08.3f*%01.1<xor8>"},
    "decimal sum": {"in": "%+08.3f%#<sum100>"},
    "Modbus ASCII": {"in": ":010402%+4x%01<modbus_lrc>", "channels": [{**CHANNEL, "decimals": 3}]},
}


@pytest.mark.parametrize("keys", SIGNED_UNITS.values(), ids=SIGNED_UNITS)
@pytest.mark.parametrize("value", [-0.5, 0.0, 0.2])
def test_the_simulated_device_speaks_these_forms(keys: dict[str, Any], value: float) -> None:
    device = gauge(**keys)
    far_end = SimulatedAscii(device.options, lambda channel: value)
    (reading,) = poll(device, far_end.receive(b"?\r"))
    assert reading.value == pytest.approx(value)


def test_a_unit_that_the_gauge_switches_itself() -> None:
    """An auto-range display: +001.234mm and +123.400um are 1.234 mm and 0.1234 mm."""
    device = gauge(**{"in": "%+08.3f%{mm=1|um=0.001}"})
    assert poll(device, b"+001.234mm\r\n")[0].value == pytest.approx(1.234)
    assert poll(device, b"+123.400um\r\n")[0].value == pytest.approx(0.1234)
    assert fault(device, b"+123.400nm\r\n") is Quality.MISMATCH


@pytest.mark.parametrize(
    "kind",
    ["sum8", "negative_sum8", "xor8", "crc8", "crc16_modbus", "sum16", "crc_ccitt", "crc_xmodem"],
)
@pytest.mark.parametrize("converter", ["%<{}>", "%0<{}>", "%1<{}>", "%01<{}>", "%#<{}>"])
def test_checksums_find_every_turned_bit(kind: str, converter: str) -> None:
    """The reply is the simulated device's: the two ends share no code."""
    device = gauge(**{"in": r"\x02%+07.3f" + converter.format(kind)})
    far_end = SimulatedAscii(device.options, lambda channel: -1.25)
    reply = far_end.receive(b"?\r")
    assert [reading.value for reading in poll(device, reply)] == [-1.25]
    for bit in range(8 * (len(reply) - 2)):
        damaged = bytearray(reply)
        damaged[bit // 8] ^= 1 << bit % 8
        if bytes(damaged).upper() == reply.upper() and converter.startswith("%0"):
            continue  # a hexadecimal digit in lower case is the same digit
        if converter.startswith(("%1", "%01")) and bit < 8:
            assert fault(device, bytes(damaged)) is Quality.MISMATCH
        else:
            assert fault(device, bytes(damaged)) in {Quality.CRC, Quality.MISMATCH}
