"""What a browser is told of the gauges."""

from __future__ import annotations

import pytest

from compd.page.broadcast import gauges, of_links

COLUMNS = [
    {"column": "scale_1_mm", "channel": "scale_1.position", "sign": -1, "stale_after_s": 0.5},
    {"column": "temperature_room_degC", "channel": "cabinet.room", "stale_after_s": 5.0},
]
ZERO = {"readings_mm": {"scale_1.position": 10.0}}


def shown(scale, room, **more):
    readings = {"scale_1.position": scale, "cabinet.room": room}
    return gauges({"time_s": 100.0, "readings": readings, **more}, COLUMNS)


def test_a_length_counts_from_machine_zero_and_a_temperature_is_as_it_is():
    scale, room = shown({"value": 12.5, "time_s": 99.9}, {"value": 20.25, "time_s": 98.0}, zero=ZERO)
    assert scale == {"value": -2.5, "age_s": pytest.approx(0.1)}
    assert room == {"value": 20.25, "age_s": 2.0}


def test_without_a_machine_zero_a_length_has_no_value():
    scale, _ = shown({"value": 12.5, "time_s": 99.9}, {"value": 20.25, "time_s": 98.0})
    assert "value" not in scale
    assert "fault" not in scale


def test_a_fault_has_no_value_and_an_old_reading_is_stale():
    lost = {"quality": "timeout", "detail": "no byte", "time_s": 99.9}
    scale, room = shown(lost, {"value": 20.25, "time_s": 94.0}, zero=ZERO)
    assert scale == {"fault": "timeout", "detail": "no byte"}
    assert room["fault"] == "stale"


def test_a_warning_of_status_stands_beside_its_gauge() -> None:
    readings = {"time_s": 5.0, "readings": {"a.x": {"value": 1.0, "time_s": 4.9}, "b.x": {"value": 1.0, "time_s": 4.9}}}
    columns = [{"column": name, "channel": f"{name}.x", "stale_after_s": 0.5} for name in "ab"]
    status = {"gauges": [{"channel": "a.x", "quality": "ok"}, {"channel": "b.x", "quality": "ok", "warning": "hum"}]}
    first, second = gauges(readings, columns, status)
    assert "warning" not in first
    assert second["warning"] == "hum"


def test_the_strips_of_links_show_no_causes_of_a_correction_of_the_tip():
    pose = {"valid": True, "tip_correction_mm": [0.0, 0.0, 0.1], "sources_mm": {"growth": [0.0, 0.0, 0.1]}}
    assert of_links(pose) == pose | {"correction_mm": [], "sources_mm": {}}
    assert of_links(pose | {"correction_mm": [0.1]})["correction_mm"] == [0.1]
    links = {"valid": True, "correction_mm": [0.1] * 3, "sources_mm": {"growth": [0.1] * 3}}
    assert of_links(links) is links
