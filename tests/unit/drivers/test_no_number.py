"""What devices send in place of a value is no reading, on any line; a stated range decides of full-scale words."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import pytest

from compd.configuration import load
from compd.gauge import Quality, Reading, good
from compd.plugins import GAUGES
from compd.plugins import load as load_driver
from compd.pushed_gauge import Message
from compd.source_time import Arrival
from tests.support import ascii_gauge
from tests.support.paths import CONFIG
from tests.support.pushed_gauges import gauge as pushed
from tests.unit.drivers.test_modbus import channel, read
from tests.unit.drivers.test_serial_frame import framed
from tests.unit.drivers.test_serial_frame import gauge as frame_gauge
from tests.unit.drivers.test_serial_frame import poll as poll_frame

SCPI = [9.9e37, -9.9e37, 9.91e37, -9.91e37, 3.4028234e38]
WIDE = (-1e30, 1e30)


def registers(value: float) -> list[int]:
    return list(struct.unpack(">HH", struct.pack(">f", value)))


def text(form: str, reply: bytes, **keys: Any) -> Reading:
    device = ascii_gauge.gauge(**{"in": form, "channels": [{"name": "value", "unit": "mm", **keys}]})
    (reading,) = ascii_gauge.poll(device, reply + b"\r\n")
    return reading


def node(payload: Any, **keys: Any) -> Reading:
    measured = pushed("opc_ua", channels=[{"name": "a", "node": "ns=2;s=a", "unit": "mm", **keys}])
    (heard,) = measured.receive(Message("ns=2;s=a", payload, Arrival(100.0, 1.8e9), 1.8e9))
    return heard.reading


def topic(payload: bytes, **keys: Any) -> Reading:
    measured = pushed("mqtt", period_s=1.0, channels=[{"name": "a", "topic": "a", "unit": "mm", **keys}])
    return measured.decode(0, Message("a", payload, Arrival(100.0, 1.8e9), math.nan), 100.0)


@pytest.mark.parametrize("value", SCPI)
@pytest.mark.parametrize("unit", ["mm", "nm", "inch"])
def test_scpi_numbers_are_no_readings_whatever_range_is_stated(value: float, unit: str) -> None:
    written = f"{value:+.2E}".encode()
    for reading in (
        text("%e", written, unit=unit),
        text("%e", written, unit=unit, range=WIDE),
        text("%e%{mm=1|um=0.001}", written + b"um"),
        node(value, unit=unit, range=WIDE),
        topic(written, unit=unit, range=WIDE),
        *read(registers(value), channel(type="float32")),
        *read(registers(value), channel(type="float32", scale=1e-6, lowest=-1e30, highest=1e30)),
        *poll_frame(
            frame_gauge(
                frame="5A 01 .. .. .. .. CS",
                channels=[{"name": "a", "at": 2, "type": "float32", "unit": unit, "range": WIDE}],
            ),
            framed("5A 01" + struct.pack("<f", value).hex()),
        ),
        good(value, 0.0),
    ):
        assert reading.quality is Quality.NOT_FINITE, reading
        assert math.isnan(reading.value)


@pytest.mark.parametrize(
    ("kind", "words", "quality"),
    [
        ("int16", [0x7FFF], Quality.OVER_RANGE),
        ("int16", [0x8000], Quality.UNDER_RANGE),
        ("uint16", [0xFFFF], Quality.OVER_RANGE),
        ("int32", [0x7FFF, 0xFFFF], Quality.OVER_RANGE),
        ("int32", [0x8000, 0x0000], Quality.UNDER_RANGE),
        ("uint32", [0xFFFF, 0xFFFF], Quality.OVER_RANGE),
        ("int64", [0x7FFF, 0xFFFF, 0xFFFF, 0xFFFF], Quality.OVER_RANGE),
        ("int24", [0x7FFF, 0xFF00], Quality.OVER_RANGE),
        ("bcd16", [0x9999], Quality.OVER_RANGE),
        ("int16", [0x10000 - 9999], Quality.SENSOR_FAULT),
        ("float32", registers(-9999.0), Quality.SENSOR_FAULT),
        ("float32", registers(-99999.0), Quality.SENSOR_FAULT),
    ],
)
def test_full_scale_words_count_only_in_a_range_that_contains_them(
    kind: str, words: list[int], quality: Quality
) -> None:
    (refused,) = read(words, channel(type=kind, scale=0.001))
    assert refused.quality is quality
    assert "`lowest` and `highest` of the channel" in refused.detail
    (one_sided,) = read(words, channel(type=kind, scale=0.001, lowest=-1e17))
    assert not one_sided.ok
    (contained,) = read(words, channel(type=kind, scale=0.001, lowest=-1e17, highest=1e17))
    assert contained.ok
    (beyond,) = read(words, channel(type=kind, scale=0.001, lowest=-1, highest=1))
    assert beyond.quality in (Quality.OVER_RANGE, Quality.UNDER_RANGE)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("int16", [0xFFFF]),
        ("uint16", [0x7FFF]),
        ("uint16", [0x8000]),
        ("int32", [0xFFFF, 0xFFFF]),
        ("uint8", [0xFF00]),
        ("int16", [0x7FFE]),
        ("float32", registers(-9998.0)),
        ("float32", registers(32767.0)),
    ],
)
def test_other_numbers_are_readings(kind: str, words: list[int]) -> None:
    (reading,) = read(words, channel(type=kind))
    assert reading.ok


@pytest.mark.parametrize(
    ("form", "reply", "keys"),
    [
        ("%f", b"-9999.0", {}),
        ("%d", b"-9999", {"decimals": 3}),
        ("%{+=1|-=-1}%f", b"-9999.0", {}),
        ("%f%{mm=1|um=0.001}", b"-9999.0um", {}),
        ("%{+=1|-=-1}%4x%{mm=1|um=0.001}", b"+FFFFum", {}),
        ("%+4x", b"7FFF", {"scale": 0.001}),
        ("%+4x", b"8000", {"scale": 0.001}),
        ("%8x", b"FFFFFFFF", {"scale": 1e-6}),
    ],
)
def test_the_same_in_text(form: str, reply: bytes, keys: dict[str, Any]) -> None:
    assert not text(form, reply, **keys).ok
    assert text(form, reply, **keys, range=(-1e5, 1e5)).ok


def test_the_same_in_frames_nodes_and_topics() -> None:
    short = {"name": "a", "at": 2, "type": "int16", "unit": "mm"}
    for data in ("5A 01 FF 7F", "5A 01 00 80", "5A 01 F1 D8"):
        (refused,) = poll_frame(frame_gauge(channels=[short]), framed(data))
        (contained,) = poll_frame(frame_gauge(channels=[short | {"range": (-1e5, 1e5)}]), framed(data))
        assert not refused.ok
        assert contained.ok
    for payload in (32767, -32768, 65535, -9999, -9999.0):
        assert not node(payload).ok
        assert node(payload, range=(-1e5, 1e5)).ok
    assert node(32767.0).ok, "a float has no full scale"
    assert not topic(b"-9999").ok
    assert topic(b"-9999", range=(-1e5, 1e5)).ok


MODBUS = "{name: u1, function: 4, address: 0, type: float32, unit: mm, lowest: -5, highest: 5}"


def test_check_warns_of_every_channel_without_a_range(tmp_path: Path) -> None:
    shipped = (CONFIG / "tripod-cmm.yaml").read_text()
    assert MODBUS in shipped
    path = tmp_path / "mine.yaml"
    path.write_text(shipped.replace(MODBUS, MODBUS.replace(", highest: 5", "")))
    (warning,) = load(path).warnings
    assert "gauges.frame_u.channels: no range is stated" in warning.where + ": " + warning.what
    assert warning.value == "u1"
    assert "`lowest` and `highest`" in warning.next_step


@pytest.mark.parametrize("name", [path.name for path in sorted(CONFIG.glob("*.yaml"))])
def test_a_shipped_machine_states_every_range(name: str) -> None:
    assert load(CONFIG / name).warnings == ()


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"driver": "sylvac_optors", "unit": "mm"}, "range_mm"),
        ({"driver": "tesa_tt80", "model": "TT90", "unit": "um"}, "range_mm"),
        ({"driver": "r4dcb08", "unit": 1, "sensors": [1]}, ""),
    ],
)
def test_a_preset_names_its_own_key(options: dict[str, Any], key: str) -> None:
    kind = load_driver(GAUGES, options["driver"], "test")
    made = kind(kind.Options.model_validate({"line": "line", **options}))
    assert [doubt.location for doubt in made.doubts()] == ([(key,)] if key else [])
    if key:
        stated = kind(kind.Options.model_validate({"line": "line", **options, key: [-1, 1]}))
        assert not list(stated.doubts())
