"""DL-RS1A: transcripts of M0 and MS, heads without a value, and what must not pass."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from compd.gauge import LineFault, Quality, Reading
from compd.lines import StreamLine
from compd_drivers.keyence_gt2_dlrs1a import KeyenceGt2DlRs1a
from tests.support.wire_rig import InstantClock, ScriptedPort


def read(reply: bytes, **options: object) -> list[tuple[Quality, float]]:
    clock = InstantClock()
    port = ScriptedPort(clock, device=lambda request: reply)
    raw = {"driver": "d", "line": "l", "heads": 3, **options}
    gauge = KeyenceGt2DlRs1a(KeyenceGt2DlRs1a.Options.model_validate(raw))
    readings: list[Reading] = list(gauge.read(StreamLine(port, 0.1, 0.001, clock)))
    assert set(port.written) == {str(options.get("request", "M0")).encode() + b"\r\n"}
    assert [channel.name for channel in gauge.channels] == [str(i + 1) for i in range(len(readings))]
    return [(reading.quality, reading.value) for reading in readings]


def fault_of(reply: bytes, **options: object) -> LineFault:
    with pytest.raises(LineFault) as caught:
        read(reply, **options)
    return caught.value


def test_values_of_all_heads() -> None:
    ok = Quality.OK
    assert read(b"M0,+000.0005,-000.1234,+012.0000\r\n") == [(ok, 0.0005), (ok, -0.1234), (ok, 12.0)]
    assert read(b"MS,02,+000.0005,04,-000.1234,00,+012.0000\r\n", request="MS") == [
        (ok, 0.0005),
        (ok, -0.1234),
        (ok, 12.0),
    ]
    assert read(b"M0,-000.0001\r\n", heads=1) == [(ok, -0.0001)]


@pytest.mark.parametrize(
    ("field", "quality"),
    [
        (b"+199.9990", Quality.OVER_RANGE),
        (b"-199.9990", Quality.UNDER_RANGE),
        (b"-999.9999", Quality.UNDER_RANGE),
        (b"---------", Quality.SENSOR_FAULT),
        (b"+FFF.FFFF", Quality.SENSOR_FAULT),
    ],
)
def test_a_head_without_a_value_leaves_the_others_theirs(field: bytes, quality: Quality) -> None:
    first, second, third = read(b"M0,+000.0005," + field + b",-000.0001\r\n")
    assert first == (Quality.OK, 0.0005)
    assert second[0] is quality
    assert third == (Quality.OK, -0.0001)


def test_the_largest_number_that_is_a_length() -> None:
    assert read(b"M0,+199.9989\r\n", heads=1) == [(Quality.OK, 199.9989)]


@pytest.mark.parametrize("reply", [b"ER,M0,31\r\n", b"ER,M0,255\r\n"])
def test_an_error_reply_is_named_and_quoted(reply: bytes) -> None:
    fault = fault_of(reply)
    assert fault.quality is Quality.DEVICE_ERROR
    assert fault.detail == reply.decode().strip()


@pytest.mark.parametrize(
    "reply",
    [
        b"M0,+000.0005,-000.1234\r\n",  # two heads of three
        b"M0,+000.0005,-000.1234,+012.0000,+000.0000\r\n",
        b"MS,+000.0005,-000.1234,+012.0000\r\n",
        b"SR,+000.0005,-000.1234,+012.0000\r\n",
        b"M0,+000.0005,-000.12\xb34,+012.0000\r\n",
        b"M0,+000.0005,-000.12 4,+012.0000\r\n",
        b"M0,+000.0005,-00.1234,+012.0000\r\n",
        b"M0,+000.0005,-000,1234,+012.0000\r\n",
        b"\xffM0,+000.0005,-000.1234,+012.0000\r\n",
        b"M0,+000.0005,\x00000.1234,+012.0000\r\n",
        b"\r\n",
    ],
)
def test_what_is_not_one_number_per_head_is_a_mismatch(reply: bytes) -> None:
    assert fault_of(reply).quality is Quality.MISMATCH


def test_a_status_that_is_none_is_a_mismatch() -> None:
    assert fault_of(b"MS,0x,+000.0005\r\n", heads=1, request="MS").quality is Quality.MISMATCH
    assert fault_of(b"MS,02\r\n", heads=1, request="MS").quality is Quality.MISMATCH


def test_silence_and_a_reply_without_its_end() -> None:
    assert fault_of(b"").quality is Quality.TIMEOUT
    assert fault_of(b"M0,+000.0005").quality is Quality.INCOMPLETE
    assert fault_of(b"M0,+000.0005,-000.1234,+012.0000\r").quality is Quality.INCOMPLETE


@pytest.mark.parametrize("heads", [0, 16])
def test_no_unit_has_so_many_heads(heads: int) -> None:
    with pytest.raises(ValidationError, match="heads"):
        KeyenceGt2DlRs1a.Options.model_validate({"driver": "d", "line": "l", "heads": heads})
