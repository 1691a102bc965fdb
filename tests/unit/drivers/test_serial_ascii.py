"""The described ASCII gauge: descriptions from manuals' pages, its reply formats, and what must never pass."""

from __future__ import annotations

import binascii
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from compd.commissioning.conformance.report import driver_under_test, run_conformance
from compd.gauge import LineFault, Quality, Reading
from compd.lines.checksums import CHECKSUMS
from compd.lines.stream import StreamLine
from compd_drivers.reply_format import ReplyFormat
from compd_drivers.simulated.serial_ascii import SimulatedAscii
from tests.support.ascii_gauge import CHANNEL, fault, gauge, line_with, poll
from tests.support.wire_rig import InstantClock, ScriptedPort

# --- reply formats -------------------------------------------------------------------------------------------


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
    (reading,) = poll(device, far_end.hear(b"?\r"))
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
    reply = far_end.hear(b"?\r")
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


# --- descriptions out of manuals' pages ----------------------------------------------------------------------


def test_magnescale_mg80() -> None:
    """MG80-SC1 manual, page 39: module number, module, mode, unit, judgement, 8 characters; blank between channels."""
    word = {"   Error": "sensor_fault"}
    device = gauge(
        **{
            "out": "R",
            "in": "00NM%*[UGLE]%(a)+08.4f 01NM%*[UGLE]%(b)+08.4f",
            "channels": [{"name": "a", "unit": "mm", "instead": word}, {"name": "b", "unit": "mm", "instead": word}],
        }
    )
    assert [r.value for r in poll(device, b"00NMG+99.9999 01NML-00.1250\r\n")] == [99.9999, -0.125]
    first, second = poll(device, b"00NME   Error 01NMG-00.1250\r\n")
    assert (first.quality, second.value) == (Quality.SENSOR_FAULT, -0.125)
    assert fault(device, b"00NMG+F0.0001 01NMG-00.1250\r\n") is Quality.MISMATCH  # the manual's overflow
    assert fault(device, b"00AMG+99.9999 01NML-00.1250\r\n") is Quality.MISMATCH  # shows the maximum


def test_wagner_force_gauge() -> None:
    """Force Ten manual, page 25: sign or blank, 5 digits and point, unit; HELP instead when overloaded."""
    device = gauge(
        **{
            "in": "% 7.2f LB%*?[ Peak]",
            "in_terminator": r" \r\n",
            "channels": [{"name": "force", "unit": "N", "scale": 4.4482216152605}],
            "errors": [{"in": "%*?[ ]HELP%*?[ LB]", "quality": "over_range"}],
        }
    )
    assert poll(device, b" 100.00 LB \r\n")[0].value == pytest.approx(444.82216152605)
    assert poll(device, b" HELP LB \r\n")[0].quality is Quality.OVER_RANGE


def test_surface_tester_in_three_lines() -> None:
    """A reply of several lines: the terminator stands between them; an error reply has one line only."""
    device = gauge(
        **{
            "in": r"A=%(a)+.3f\r\nB=%(b)+.3f",
            "channels": [{"name": "a", "unit": "um"}, {"name": "b", "unit": "um"}],
            "errors": [{"in": "NG%*2d", "quality": "device_error", "says": "not ready"}],
        }
    )
    assert [r.value for r in poll(device, b"A=+1.500\r\nB=-2.500\r\n")] == [
        pytest.approx(0.0015),
        pytest.approx(-0.0025),
    ]
    readings = poll(device, b"NG07\r\n")
    assert {r.quality for r in readings} == {Quality.DEVICE_ERROR}
    assert readings[0].detail == "NG07: not ready"


def test_whole_numbers_with_fixed_decimals_and_a_range() -> None:
    channel = {**CHANNEL, "decimals": 4, "scale": -1, "range": [-1.0, 1.0]}
    device = gauge(**{"in": "%+09d", "channels": [channel]})
    assert poll(device, b"+00002971\r\n")[0].value == -0.2971
    assert poll(device, b"+00012971\r\n")[0].quality is Quality.UNDER_RANGE
    assert poll(device, b"-00012971\r\n")[0].quality is Quality.OVER_RANGE


def test_a_reply_without_an_end_has_a_fixed_length() -> None:
    device = gauge(**{"in": "%+07.3f", "in_terminator": ""})
    assert poll(device, b"+01.500")[0].value == 1.5
    assert fault(device, b"+01.50") is Quality.INCOMPLETE
    assert fault(device, b"+01.5000") is Quality.MISMATCH


# --- timeouts, extra input, order ----------------------------------------------------------------------------


def test_bytes_behind_the_reply() -> None:
    assert fault(gauge(**{"in": "%f"}), b"+1.5\r\n+") is Quality.MISMATCH
    assert poll(gauge(**{"in": "%f", "extra_input": "ignore"}), b"+1.5\r\n+")[0].value == 1.5


def test_two_timeouts() -> None:
    device = gauge(**{"in": "%f", "reply_timeout_s": 3.0, "gap_timeout_s": 0.5})
    assert fault(device, b"+1.5") is Quality.INCOMPLETE
    clock = InstantClock()
    line = StreamLine(ScriptedPort(clock), 0.1, 0.002, clock)
    began_s = clock.now_s
    with pytest.raises(LineFault) as caught:
        device.read(line)
    assert caught.value.quality is Quality.TIMEOUT
    assert clock.now_s - began_s == pytest.approx(3.0, abs=0.01), "virtual time: the first byte had 3 s"


def test_a_babbling_line_is_cut_off() -> None:
    assert fault(gauge(**{"in": "%f"}), b"1" * 500) is Quality.MISMATCH
    assert fault(gauge(**{"in": "%+07.3f"}), b"1" * 500) is Quality.MISMATCH


def test_one_behind_is_found_by_the_echo() -> None:
    """Every reply is the answer to the request before: without the echo all would pass."""
    pending = [b"+20.0\r\n"]

    def behind(request: bytes) -> bytes:
        pending.append(b"TT80\r\n" if request == b"ID?\r" else b"+21.0\r\n")
        return pending.pop(0)

    degrees = {"in": "%f", "channels": [{"name": "t", "unit": "degC"}]}
    line, _ = line_with(device=behind)
    assert gauge(**degrees).read(line)[0].value == 20.0
    line, _ = line_with(device=behind)
    with pytest.raises(LineFault) as caught:
        gauge(**degrees, echo={"out": "ID?", "in": "TT%*2d"}).read(line)
    assert caught.value.quality is Quality.MISMATCH


def test_init_is_said_again_on_a_new_line() -> None:
    device = gauge(
        **{"in": "%f", "channels": [{"name": "t", "unit": "degC"}], "init": [{"out": "FORMAT 1", "in": "OK"}]}
    )
    answers = {b"FORMAT 1\r": b"OK\r\n", b"?\r": b"+20.0\r\n"}
    for _ in range(2):
        line, port = line_with(device=answers.__getitem__)
        device.read(line)
        device.read(line)
        assert port.written == [b"FORMAT 1\r", b"?\r", b"?\r"]


def test_silent_in_its_menu_and_lost() -> None:
    device = gauge(**{"in": "%f", "silent_in_menu": True})
    clock = InstantClock()
    answers = {"now": b"+1.5\r\n"}
    line = StreamLine(ScriptedPort(clock, device=lambda request: answers["now"]), 0.1, 0.002, clock)
    device.read(line)
    answers["now"] = b""
    qualities = []
    for _ in range(3):
        with pytest.raises(LineFault) as caught:
            device.read(line)
        qualities.append(caught.value.quality)
    assert qualities == [Quality.TIMEOUT, Quality.SILENT, Quality.SILENT]
    assert fault(device, b"") is Quality.TIMEOUT, "a new connection on which it has never answered"


# --- devices that speak unasked ------------------------------------------------------------------------------


def listening(*script: bytes) -> list[Reading]:
    device = gauge(**{"out": "", "out_terminator": "", "in": "%f", "channels": [{"name": "t", "unit": "degC"}]})
    line, _ = line_with(*script)
    return list(device.read(line))


def test_the_newest_whole_line_counts_and_never_a_half_one() -> None:
    # what waits is old; then the end of a line, and a whole one
    (reading,) = listening(b"+10.0\r\n+11.0\r\n+1", b"", b"2.5\r\n+13.0", b"\r\n")
    assert reading.value == 13.0
    (reading,) = listening(b"", b"+12.5\r\n", b"+13.0\r\n")
    assert reading.value == 13.0


def test_the_age_of_what_comes_unasked_is_never_understated() -> None:
    clock = InstantClock()
    port = ScriptedPort(clock, [b"+10.0\r\n", b"", b"+12.5\r\n", b"+13.0\r\n"])
    line = StreamLine(port, 0.1, 0.002, clock)
    began_s = clock.now_s
    device = gauge(**{"out": "", "out_terminator": "", "in": "%f", "channels": [{"name": "t", "unit": "degC"}]})
    assert device.read(line)[0].time_s == began_s
    assert port.written == []


# --- several requests in one gauge ---------------------------------------------------------------------------

PROBES: dict[str, Any] = {
    "out": "",
    "requests": [{"out": f"M{k}", "in": f"%(p{k})+08.4f"} for k in (1, 2, 3)],
    "channels": [{"name": f"p{k}", "unit": "mm"} for k in (3, 1, 2)],
    "errors": [{"in": "ERR%*1d", "quality": "sensor_fault"}],
}


def test_each_value_has_its_own_request_and_time() -> None:
    device = gauge(**PROBES)
    values = {"p1": 1.0, "p2": -2.0, "p3": 3.5}
    far_end = SimulatedAscii(device.options, values.__getitem__)
    line, port = line_with(device=far_end.hear)
    readings = device.read(line)
    assert [reading.value for reading in readings] == [3.5, 1.0, -2.0], "in the order of the channels"
    assert port.written == [b"M1\r", b"M2\r", b"M3\r"]
    p3, p1, p2 = (reading.time_s for reading in readings)
    assert p1 < p2 < p3
    assert device.traffic() == [(3, 10)] * 3


def test_an_error_to_one_request_leaves_the_others_their_values() -> None:
    answers = {b"M1\r": b"+01.0000\r\n", b"M2\r": b"ERR0\r\n", b"M3\r": b"+03.0000\r\n"}
    line, _ = line_with(device=answers.__getitem__)
    readings = gauge(**PROBES).read(line)
    assert [reading.quality for reading in readings] == [Quality.OK, Quality.OK, Quality.SENSOR_FAULT]


def test_a_reply_to_another_request_is_no_value_where_replies_say_whose_they_are() -> None:
    named = [{"out": f"M{k}", "in": f"{k}:%(p{k})+08.4f"} for k in (1, 2, 3)]
    device = gauge(**{**PROBES, "requests": named})
    line, _ = line_with(device=lambda request: b"1:+01.0000\r\n")
    with pytest.raises(LineFault) as caught:
        device.read(line)
    assert caught.value.quality is Quality.MISMATCH


def test_what_all_replies_begin_with_is_whose_they_are() -> None:
    unit_2 = [{"out": f"2M{k}", "in": f"2,{k}:%(p{k})+08.4f"} for k in (1, 2, 3)]
    assert gauge(**{**PROBES, "requests": unit_2}).reply_identity == "2,"
    assert gauge(**PROBES).reply_identity is None


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ({"out": "?"}, "there is no `out`"),
        ({"in": "%(p1)f"}, "either `in` or `requests`"),
        ({"requests": []}, "either `in` or `requests`"),
        ({"requests": PROBES["requests"][:2]}, r"no %\(p3\)f"),
        ({"requests": [*PROBES["requests"], {"out": "M4", "in": "%(p1)f"}]}, "p1 stands in several replies"),
        ({"requests": [{"out": "M1", "in": "%f"}]}, "without name|has no"),
    ],
)
def test_requests_that_cannot_be_are_refused(keys: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        gauge(**{**PROBES, **keys})


def test_several_requests_on_wires_that_go_wrong() -> None:
    options = {**PROBES, "out_terminator": r"\r", "in_terminator": r"\r\n"}
    results = list(run_conformance(driver_under_test("serial_ascii", options), on_real_wires=False))
    assert [result for _, result in results if result.verdict == "FAIL"] == []


class TalkingPort(ScriptedPort):
    """A device that sends a number every `period_s`, byte by byte; its sensor is read when a line begins."""

    character_s = 1e-3

    def __init__(self, clock: InstantClock, period_s: float) -> None:
        super().__init__(clock)
        self._talk_clock = clock
        self._period_s = period_s
        self._read_s = clock.now_s

    def line(self, number: int) -> bytes:
        return f"{number:+08.1f}\r\n".encode()

    def begins_s(self, number: int) -> float:
        return 100.0 + number * self._period_s

    def read(self, timeout_s: float) -> bytes:
        clock, until_s = self._talk_clock, self._talk_clock.now_s + max(0.0, timeout_s)
        came, due_s = b"", self._read_s
        number = max(0, int((self._read_s - 100.0) / self._period_s) - 1)
        while self.begins_s(number) <= until_s:
            for place, byte in enumerate(self.line(number), start=1):
                at_s = self.begins_s(number) + place * self.character_s
                if self._read_s < at_s <= (clock.now_s if came else until_s):
                    came, due_s = came + bytes([byte]), at_s
                    clock.now_s = max(clock.now_s, at_s)
            number += 1
        if came:
            self._read_s = due_s
        else:
            clock.now_s = until_s
        return came


UNASKED = {"out": "", "out_terminator": "", "in": "%+08.1f", "channels": [{"name": "t", "unit": "degC"}]}


@pytest.mark.parametrize("period_s", [0.011, 0.02, 0.1])
def test_a_talker_is_read_at_its_full_rate(period_s: float) -> None:
    clock = InstantClock()
    port = TalkingPort(clock, period_s)
    line = StreamLine(port, 0.3, 0.002, clock)
    device = gauge(**UNASKED)
    values = []
    for _ in range(20):
        (reading,) = device.read(line)
        values.append(int(reading.value))
        assert reading.time_s <= port.begins_s(int(reading.value)), "its age is never understated"
        assert clock.now_s - reading.time_s < 2.5 * period_s + 0.02
    assert values == list(range(values[0], values[0] + 20)), "not one line is left out"


def test_of_a_talker_that_is_seldom_asked_the_newest_line_counts() -> None:
    clock = InstantClock()
    port = TalkingPort(clock, 0.02)
    line = StreamLine(port, 0.3, 0.002, clock)
    device = gauge(**UNASKED)
    for _ in range(5):
        (reading,) = device.read(line)
        assert clock.now_s - reading.time_s < 0.06
        assert reading.time_s <= port.begins_s(int(reading.value))
        clock.now_s += 0.5


def test_a_talker_that_stops_within_a_line_has_its_own_patience() -> None:
    clock = InstantClock()
    script = [b"", b"+00001.0\r\n", b"+00002", b""]
    line = StreamLine(ScriptedPort(clock, script), 0.3, 0.002, clock)
    device = gauge(**UNASKED, gap_timeout_s=2.0)
    began_s = clock.now_s
    with pytest.raises(LineFault, match="incomplete"):
        device.read(line)
    assert clock.now_s - began_s >= 2.0


def test_a_talker_that_is_slower_than_the_timeout_is_told_so() -> None:
    clock = InstantClock()
    line = StreamLine(TalkingPort(clock, 1.0), 0.3, 0.002, clock)
    with pytest.raises(LineFault, match="`reply_timeout_s` must be longer than the period"):
        gauge(**UNASKED).read(line)
    patient = gauge(**UNASKED, reply_timeout_s=1.5)
    assert patient.read(line)[0].ok


def test_a_device_that_stops_speaking() -> None:
    with pytest.raises(LineFault) as caught:
        listening(b"", b"+12.5\r\n")
    assert caught.value.quality is Quality.TIMEOUT
    with pytest.raises(LineFault) as caught:
        listening(b"", b"+12.5\r\n", b"+13.")
    assert caught.value.quality is Quality.INCOMPLETE
