"""A daemon that starts compares its length gauges with what they showed last."""

from __future__ import annotations

import json
import math
import threading

import pytest

from compd.live.memory.trust_memory import Doubt, TrustMemory
from compd.live.service import last_readings
from compd.live.service.last_readings import FILE_NAME, LastReadings

CHANNELS = ("scale_1.position", "joints.1", "joints.2")
HASH = "0123456789abcdef"


class Clock:
    """Every look is a second later; the test says how many there are."""

    def __init__(self, looks: int = 0, now_s: float = 100.0) -> None:
        self.now_s, self.looks = now_s, looks

    def monotonic(self) -> float:
        return self.now_s

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        self.looks -= 1
        self.now_s += timeout_s
        return self.looks < 0


def memory() -> TrustMemory:
    return TrustMemory(CHANNELS, [0.001] * len(CHANNELS))


def written(tmp_path, change=lambda memory: None, now_s=100.0) -> None:
    """As a daemon leaves it."""
    left = memory()
    left.believe(0, 12.5, now_s)
    left.believe(1, -0.25, now_s)
    change(left)
    last = LastReadings(tmp_path, HASH, left, Clock(now_s=now_s))
    last.start()
    last.stop()


def recalled(tmp_path, now_s=103.0, zero_hash=HASH) -> TrustMemory:
    found = memory()
    LastReadings(tmp_path, zero_hash, found, Clock(now_s=now_s)).recall()
    return found


def test_a_daemon_that_was_away_for_a_moment_goes_on(tmp_path):
    written(tmp_path)
    found = recalled(tmp_path, now_s=103.0)
    assert found.value[:2].tolist() == [12.5, -0.25]
    assert math.isnan(found.value[2])
    assert found.doubt[:3].tolist() == [Doubt.NONE] * 3
    assert found.time_s[0] == 101.0


@pytest.mark.parametrize("anew", ["the computer", "long after", "the clock"])
def test_after_longer_every_gauge_must_show_what_it_showed(tmp_path, monkeypatch, anew):
    written(tmp_path)
    if anew == "the computer":
        monkeypatch.setattr(last_readings, "boot_id", lambda: "another one")
    found = recalled(tmp_path, now_s={"the computer": 103.0, "long after": 200.0, "the clock": 5.0}[anew])
    assert found.doubt[:3].tolist() == [Doubt.LOST, Doubt.LOST, Doubt.NONE], "the third has never been read"
    assert found.witness[0, :2].tolist() == [12.5, -0.25]


def test_what_was_not_believed_is_not_believed_after_a_start(tmp_path):
    def doubt(left: TrustMemory) -> None:
        left.distrust(0, Doubt.RETURNED, 5.0)
        left.distrust(1, Doubt.VOTED, math.nan)
        left.vote({"joints.1": "stuck"})

    written(tmp_path, doubt)
    found = recalled(tmp_path)
    assert "came back 5.000 mm away" in found.explanation(0)
    assert found.explanation(1).startswith("stuck: look at it")


@pytest.mark.parametrize("content", ["", "{", "[" * 100_000, "{}", '{"format": 1}', "\xff", '{"format": 2}'])
def test_a_damaged_file_is_said_and_says_nothing(tmp_path, content):
    (tmp_path / FILE_NAME).write_text(content, encoding="latin-1")
    assert math.isnan(recalled(tmp_path).value[0])


def test_readings_of_another_configuration_say_nothing(tmp_path):
    written(tmp_path)
    assert math.isnan(recalled(tmp_path, zero_hash="another").value[0])


def test_a_machine_at_rest_is_written_once_and_a_disk_that_refuses_stops_nothing(tmp_path):
    left = memory()
    left.believe(0, 12.5, 100.0)
    last = LastReadings(tmp_path / "state", HASH, left, Clock())
    last._write_if_changed()
    file = tmp_path / "state" / FILE_NAME
    first = file.stat().st_ino
    left.believe(0, 12.5004, 101.0)
    last._write_if_changed()
    assert file.stat().st_ino == first
    left.believe(0, 12.6, 102.0)
    last._write_if_changed()
    assert json.loads(file.read_text())["readings"]["scale_1.position"]["value_mm"] == 12.6
    (tmp_path / "file").write_text("")
    last = LastReadings(tmp_path / "file" / "no directory", HASH, left, Clock())
    last.start()
    last.stop()


def test_a_thermometer_that_was_not_believed_is_not_believed_after_a_start(tmp_path):
    def with_thermometer() -> TrustMemory:
        return TrustMemory((*CHANNELS, "cabinet.link_1"), [0.001] * 3 + [0.25], ["degC"])

    left = with_thermometer()
    left.believe(0, 12.5, 100.0)
    left.believe(3, 23.0, 100.0)
    left.distrust(3, Doubt.JUMPED, 5.0)
    last = LastReadings(tmp_path, HASH, left, Clock(now_s=100.0))
    last.start()
    last.stop()
    found = with_thermometer()
    LastReadings(tmp_path, HASH, found, Clock(now_s=103.0)).recall()
    assert found.value[3] == 23.0
    assert "jumped by 5.000 degC: look at it, then `compd accept cabinet`" in found.explanation(3)


def test_a_file_that_was_changed_is_damaged_and_one_without_a_checksum_is_warned_of(tmp_path, capsys):
    written(tmp_path)
    path = tmp_path / FILE_NAME
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"time_s": 99.0}))
    assert math.isnan(recalled(tmp_path).value[0])
    assert "the checksum does not fit" in capsys.readouterr().out
    del content["checksum"]
    path.write_text(json.dumps(content))
    assert recalled(tmp_path).value[0] == 12.5
    assert "have no checksum" in capsys.readouterr().out
