"""The described ASCII gauge: descriptions from manuals' pages, and exchanges that must never pass."""

from __future__ import annotations

import pytest

from compd.gauge import LineFault, Quality
from compd.lines import StreamLine
from tests.support.ascii_gauge import CHANNEL, fault, gauge, line_with, poll
from tests.support.wire_rig import InstantClock, ScriptedPort


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
