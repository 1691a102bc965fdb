"""Driver threads: lines that die, come back and delay nobody; drivers that fail; no wrong number as ok."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import structlog

from compd.gauge import Quality
from compd.live.acquisition.acquisition import Acquisition
from compd.live.acquisition.shared_endpoints import Peers
from compd.live.system import THIS_COMPUTER
from tests.support.patience import PATIENCE_S
from tests.support.sampled import sampled
from tests.support.wire_rig import SETTINGS, Rig, WatchedLatest, rig
from tests.unit.drivers.test_simulated import CASES, Case

OK = Quality.OK
BACK_OFF_S = (0.05, 0.2)
STALE_AFTER_S = 0.5
SETTINGS_TCP = SETTINGS.validate_python({"kind": "tcp", "host": "x", "port": 1, "timeout_s": 0.1})


# --- on real ptys and ports --------------------------------------------------------------------------------


@contextmanager
def acquiring(*rigs: Rig) -> Iterator[tuple[Acquisition, WatchedLatest]]:
    """The rigs' lines under names a, b ..., their gauges ag, bg ..."""
    names = "abc"[: len(rigs)]
    gauges = {f"{name}g": built.gauges["g"] for name, built in zip(names, rigs, strict=True)}
    latest = WatchedLatest([f"{name}.{c.name}" for name, gauge in gauges.items() for c in gauge.channels])
    lines = {
        name: (built.settings.model_copy(update={"back_off_s": BACK_OFF_S}), [(f"{name}g", built.gauges["g"])])
        for name, built in zip(names, rigs, strict=True)
    }
    acquisition = Acquisition(lines, dict.fromkeys(gauges, STALE_AFTER_S), latest, THIS_COMPUTER)
    acquisition.start()
    try:
        yield acquisition, latest
    finally:
        assert acquisition.stop(PATIENCE_S)


def build_rig(tmp_path: Path, case: Case) -> Any:
    tmp_path.mkdir(exist_ok=True)
    return rig(tmp_path, case.line, {"g": case.gauge}, dict(case.values))


@pytest.mark.parametrize("case", sampled(CASES.values(), 4), ids=CASES)
def test_an_unplugged_line_is_lost_and_comes_back_by_itself(tmp_path: Path, case: Case) -> None:
    with build_rig(tmp_path, case) as device_rig, acquiring(device_rig) as (acquisition, latest):
        channel, value = f"ag.{next(iter(case.values))}", next(iter(case.values.values()))
        assert latest.wait_for(channel, OK).value == pytest.approx(value, abs=case.step)
        since = latest.now
        device_rig.wire.fault = "unplugged"
        for name in latest.channels:
            assert math.isnan(latest.wait_for(name, Quality.LINE_LOST, since).value)
        assert acquisition.status()["a"]["state"] == "lost"
        since = latest.now
        device_rig.wire.fault = None
        assert latest.wait_for(channel, OK, since).value == pytest.approx(value, abs=case.step)
        status = acquisition.status()["a"]
        assert status["state"] == "open"
        assert status["lost"] >= 1
        assert status["opened"] >= 2
        assert status["gauges"]["ag"]["faults"]["line_lost"] >= 1


@pytest.mark.parametrize("name", ["modbus TCP", "modbus RTU over TCP", "keyence"])
def test_faults_that_come_and_go_at_any_moment_leave_nothing_behind(tmp_path: Path, name: str) -> None:
    with build_rig(tmp_path, CASES[name]) as device_rig, acquiring(device_rig) as (_, latest):
        channel, value = next(iter(CASES[name].values.items()))
        for _ in range(10):
            for fault in device_rig.wire.faults:
                device_rig.wire.fault = fault
        device_rig.wire.fault = None
        reading = latest.wait_for(f"ag.{channel}", OK, latest.now)
        assert reading.value == pytest.approx(value, abs=CASES[name].step)
        assert all(
            r.value == pytest.approx(value, abs=CASES[name].step)
            for n, r in latest.history
            if r.ok and n == f"ag.{channel}"
        )


def test_a_device_that_comes_later_is_found(tmp_path: Path) -> None:
    with build_rig(tmp_path, CASES["keyence"]) as device_rig:
        device_rig.wire.fault = "unplugged"
        with acquiring(device_rig) as (_, latest):
            latest.wait_for("ag.1", Quality.LINE_LOST)
            device_rig.wire.fault = None
            latest.wait_for("ag.1", OK)


@pytest.mark.long
@pytest.mark.sample
def test_a_dead_line_does_not_delay_another(tmp_path: Path) -> None:
    dead = CASES["keyence"]._replace(line={**CASES["keyence"].line, "timeout_s": PATIENCE_S / 2})
    alive = CASES["modbus RTU"]
    with (
        build_rig(tmp_path / "a", dead) as a,
        build_rig(tmp_path / "b", alive) as b,
        acquiring(a, b) as (acquisition, latest),
    ):
        latest.wait_for("ag.1", OK)
        a.wire.fault = "silent"
        replies = a.wire.replies
        polls = acquisition.status()["a"]["gauges"]["ag"]["polls"]
        for _ in range(30):
            latest.wait_for("bg.u1", OK, latest.now)
        assert a.wire.replies <= replies + 1, "the dead line hangs in one poll"
        assert acquisition.status()["a"]["gauges"]["ag"]["polls"] <= polls + 1
        a.wire.fault = "unplugged"  # ends the wait


def test_two_lines_to_one_device_are_logged_whatever_its_names_are(tmp_path: Path) -> None:
    case = CASES["modbus TCP"]
    with structlog.testing.capture_logs() as logs, build_rig(tmp_path / "a", case) as a:
        alias = replace(a, settings=a.settings.model_copy(update={"host": "127.1"}))
        with build_rig(tmp_path / "c", case) as c, acquiring(a, alias, c) as (_, latest):
            for gauge in ("ag", "bg", "cg"):
                latest.wait_for(f"{gauge}.{next(iter(case.values))}", OK)
    (event,) = [entry for entry in logs if entry["event"] == "lines share a device"]
    assert {event["line"], *event["lines"]} == {"a", "b"}
    assert event["peer"] == f"127.0.0.1:{a.settings.port}"


def test_a_line_that_was_closed_shares_its_device_no_more() -> None:
    peers = Peers()
    with structlog.testing.capture_logs() as logs:
        peers.connected("a", "10.0.0.1:502")
        peers.closed("a")
        peers.connected("b", "10.0.0.1:502")
        peers.connected("b", "10.0.0.1:502")
    assert logs == []


@pytest.mark.parametrize(
    "name", sampled(["heidenhain 38400", "modbus RTU over TCP", "keyence", "modbus RTU", "modbus TCP"], 3)
)
def test_a_late_reply_is_never_taken_for_a_new_one(tmp_path: Path, name: str) -> None:
    case = CASES[name]
    with build_rig(tmp_path, case) as device_rig, acquiring(device_rig) as (_, latest):
        channel = next(iter(case.values))
        latest.wait_for(f"ag.{channel}", OK)
        device_rig.wire.fault = "late"
        since = latest.now
        latest.wait_for(f"ag.{channel}", Quality.TIMEOUT, since)
        device_rig.values[channel] = case.values[channel] / 2  # before the fault ends: every sound reply shows this
        changed_s = THIS_COMPUTER.monotonic()
        device_rig.wire.fault = None
        while (reading := latest.wait_for(f"ag.{channel}", OK, since)).time_s < changed_s:
            since = latest.now
        assert reading.value == pytest.approx(case.values[channel] / 2, abs=case.step)


@pytest.mark.parametrize(
    ("fault", "quality"),
    sampled(
        [
            ("silent", Quality.TIMEOUT),
            ("garble", Quality.CRC),
            ("cut", Quality.INCOMPLETE),
            ("noise before", Quality.CRC),
            ("wrong unit", Quality.MISMATCH),
        ],
        2,
    ),
)
def test_while_a_line_is_broken_no_reading_is_ok(tmp_path: Path, fault: str, quality: Quality) -> None:
    with build_rig(tmp_path, CASES["modbus RTU"]) as device_rig, acquiring(device_rig) as (_, latest):
        latest.wait_for("ag.u1", OK)
        device_rig.wire.fault = fault
        since = latest.now
        latest.wait_for("ag.u1", quality, since)
        since = latest.now
        latest.wait_for("ag.u1", quality, since)
        assert not [reading for _, reading in latest.history[since:] if reading.ok]
