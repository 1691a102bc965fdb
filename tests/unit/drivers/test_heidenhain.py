"""Scale display: transcripts of its 17 bytes, and what must not pass for a position."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compd.gauge import LineFault, Quality, Reading
from compd.lines import StreamLine
from compd_drivers.heidenhain_nd28x import HeidenhainNd28x
from tests.support.wire_rig import InstantClock, ScriptedPort


def read(*replies: bytes, **options: object) -> list[Reading]:
    """One poll of a display that answers with `replies`, the last one again and again."""
    waiting = list(replies)
    clock = InstantClock()
    port = ScriptedPort(clock, device=lambda request: waiting.pop(0) if len(waiting) > 1 else waiting[0])
    gauge = HeidenhainNd28x(HeidenhainNd28x.Options.model_validate({"driver": "d", "line": "l", **options}))
    readings = gauge.read(StreamLine(port, 0.1, 0.001, clock))
    assert set(port.written) == {b"\x02"}
    return list(readings)


def fault_of(*replies: bytes, **options: object) -> Quality:
    with pytest.raises(LineFault) as caught:
        read(*replies, **options)
    return caught.value.quality


@pytest.mark.parametrize(
    ("reply", "value_mm"),
    [
        (b"+   12.3456    \r\n", 12.3456),
        (b"-    0.0005   A\r\n", -0.0005),
        (b"     0.0000    \r\n", 0.0),
        (b"+      .125    \r\n", 0.125),
        (b"- 123.45678  = \r\n", -123.45678),
        (b"+00012.3456  < \r\n", 12.3456),
    ],
)
def test_transcripts(reply: bytes, value_mm: float) -> None:
    (reading,) = read(reply)
    assert reading.quality is Quality.OK
    assert reading.value == value_mm


@pytest.mark.parametrize("reply", [b"+   12.3456 ?  \r\n", b"-    0.0000 ? A\r\n"])
def test_a_fault_of_the_display_is_named(reply: bytes) -> None:
    (reading,) = read(reply)
    assert reading.quality is Quality.SENSOR_FAULT
    assert "?" in reading.detail


@pytest.mark.parametrize(
    "reply",
    [
        b'+   0.48605 "  \r\n',  # inch, where millimetres are configured
        b"+   12.3456   S\r\n",  # smallest of a series
        b"+   12.3456   D\r\n",  # difference
        b"+   123456     \r\n",  # no decimal point
        b"+   12.34 6    \r\n",
        b"+   1.2.345    \r\n",
        b"+              \r\n",
        b"+   12.3456  A \r\n",  # a series where the comparison stands
        b"*   12.3456    \r\n",
        b"2.3456    \r\n+   1",  # out of step
        b"+   12.3456    \n\r",
    ],
)
def test_what_is_no_position_is_a_mismatch(reply: bytes) -> None:
    assert fault_of(reply) is Quality.MISMATCH


def test_inches_are_converted_where_they_are_configured() -> None:
    (reading,) = read(b'-   1.00000 "  \r\n', unit="inch")
    assert reading.value == -25.4
    assert fault_of(b"-   1.00000    \r\n", unit="inch") is Quality.MISMATCH


@given(st.integers(0, 16))
def test_a_character_with_a_wrong_parity_never_passes(index: int) -> None:
    """The port gives NUL for it."""
    reply = bytearray(b"+   12.3456    \r\n")
    reply[index] = 0
    assert fault_of(bytes(reply)) is Quality.MISMATCH


def test_silence_and_half_a_reply() -> None:
    assert fault_of(b"") is Quality.TIMEOUT
    assert fault_of(b"+   12.3") is Quality.INCOMPLETE
