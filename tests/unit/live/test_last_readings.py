"""A daemon that starts compares its length gauges with what they showed last."""

from __future__ import annotations

import json
import math
import threading

import pytest

from compd.gauge import good
from compd.live.memory.trust_memory import Doubt, TrustMemory
from compd.live.service.last_readings import FILE_NAME, LastReadings
from compd.live.system import System
from tests.unit.live.test_quantity_trust import judged

CHANNELS = ("scale_1.position", "joints.1", "joints.2")
HASH = "0123456789abcdef"


class Clock(System):
    """Every look is a second later; the test says how many there are."""

    def __init__(self, looks: int = 0, now_s: float = 100.0, boot_id: str = "") -> None:
        """`boot_id`: of another start of the computer than this one."""
        self.now_s, self.looks = now_s, looks
        self._boot_id = boot_id

    def monotonic(self) -> float:
        return self.now_s

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        self.looks -= 1
        self.now_s += timeout_s
        return self.looks < 0

    def boot_id(self) -> str:
        return self._boot_id or super().boot_id()


def memory() -> TrustMemory:
    return TrustMemory(CHANNELS, [0.001] * len(CHANNELS), scales=1)


PORTS = {"scale_1": "/dev/serial/by-id/usb-one", "joints": "192.168.10.20:502:1"}


def written(tmp_path, change=lambda memory: None, now_s=100.0) -> None:
    """As a daemon leaves it."""
    left = memory()
    left.believe(0, 12.5, now_s)
    left.believe(1, -0.25, now_s)
    change(left)
    last = LastReadings(tmp_path, HASH, left, Clock(now_s=now_s), PORTS)
    last.start()
    last.stop()


def recalled(tmp_path, now_s=103.0, zero_hash=HASH, ports=PORTS, boot_id="") -> TrustMemory:
    found = memory()
    LastReadings(tmp_path, zero_hash, found, Clock(now_s=now_s, boot_id=boot_id), ports).recall()
    return found


@pytest.mark.parametrize("now_s", [103.0, 5.0, 1e6])
def test_every_gauge_must_show_what_it_showed_however_long_the_daemon_was_away(tmp_path, now_s):
    written(tmp_path)
    found = recalled(tmp_path, now_s)
    assert found.value[:2].tolist() == [12.5, -0.25]
    assert math.isnan(found.value[2])
    assert found.doubt[:3].tolist() == [Doubt.LOST, Doubt.LOST, Doubt.NONE], "the third has never been read"
    assert found.witness[0, :2].tolist() == found.witness[1, :2].tolist() == [12.5, -0.25]
    assert not found.power_lost.any()


def test_under_a_unit_that_hides_the_kernels_files_the_start_of_the_computer_is_the_same_one(tmp_path, monkeypatch):
    monkeypatch.setenv("COMPD_BOOT_ID", System().boot_id().replace("-", ""))
    monkeypatch.setattr("compd.live.system.system._BOOT_ID", tmp_path / "hidden")
    written(tmp_path)
    monkeypatch.undo()
    assert not recalled(tmp_path).power_lost.any()


def test_where_the_computer_was_started_anew_the_gauges_may_have_been_without_power(tmp_path):
    written(tmp_path)
    found = recalled(tmp_path, boot_id="another one")
    assert found.power_lost[:2].all()
    last = LastReadings(tmp_path, HASH, found, Clock(boot_id="another one"), PORTS)
    last.start()
    last.stop()
    assert recalled(tmp_path, boot_id="another one").power_lost[:2].all(), (
        "nor is it forgotten before they have answered"
    )


def test_a_gauge_at_another_port_is_not_believed_and_stays_so(tmp_path):
    written(tmp_path)
    ports = PORTS | {"scale_1": "/dev/serial/by-id/usb-two"}
    found = recalled(tmp_path, ports=ports)
    assert found.doubt[:2].tolist() == [Doubt.REPLUGGED, Doubt.LOST]
    text = (
        "look whether it is this gauge, then `compd accept scale_1`: was at /dev/serial/by-id/usb-one, "
        "is at /dev/serial/by-id/usb-two"
    )
    assert found.explanation(0) == text
    last = LastReadings(tmp_path, HASH, found, Clock(), ports)
    last.start()
    last.stop()
    assert recalled(tmp_path, ports=ports).explanation(0) == text, "a restart is no acceptance"


def test_a_port_that_was_not_known_is_no_other_one(tmp_path):
    written(tmp_path)
    assert recalled(tmp_path, ports={}).doubt[0] == Doubt.LOST


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


@pytest.mark.parametrize(
    ("away_s", "shows_degC", "believed"), [(2.0, 20.3, True), (2.0, 28.0, False), (60.0, 28.0, True)]
)
def test_after_a_restart_a_temperature_has_changed_by_no_more_than_it_can(tmp_path, away_s, shows_degC, believed):
    judge, memory = judged("temperature_hall_degC")
    for k in range(10):
        judge.judge(good(20.0, 1000.0 + 0.1 * k), 0.0, good(20.0, 1000.0 + 0.1 * k))
    stops = LastReadings(tmp_path, "hash", memory, Clock(now_s=1001.0))
    stops.start()
    stops.stop()
    judge, memory = judged("temperature_hall_degC")
    now_s = 1001.0 + away_s
    LastReadings(tmp_path, "hash", memory, Clock(now_s=now_s)).recall()
    answers = [good(shows_degC, now_s + 0.03 * k) for k in range(50)]
    readings = [judge.judge(reading, 0.0, reading) for reading in answers]
    assert readings[0].ok is readings[-1].ok is believed
    if not believed:
        assert "jumped by +8" in readings[-1].detail or "jumped by 8" in readings[-1].detail
