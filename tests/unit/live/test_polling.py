"""What becomes of the replies of one poll, good, damaged, missing and impossible, in simulated time."""

from __future__ import annotations

import math
from typing import Any

import pytest
import structlog

from compd.gauge import LineFault, Quality, Reading, good
from compd.live.acquisition.polled_gauge import MAX_FAILURES
from tests.support.scripted_thread import SETTINGS_TCP, STALE_AFTER_S, ScriptedGauge, ScriptedThread, polls_with_faults

OK = Quality.OK


class OwnError(Exception):
    """Of a driver, that nobody else knows."""


@pytest.mark.parametrize("quality", [Quality.CRC, Quality.TIMEOUT, Quality.DEVICE_ERROR])
@pytest.mark.parametrize("failures", [1, MAX_FAILURES, MAX_FAILURES + 1])
def test_a_gauge_rests_after_more_than_ten_failures_in_a_row(quality: Quality, failures: int) -> None:
    polls = 0

    def poll() -> list[Reading]:
        nonlocal polls
        polls += 1
        scripted.clock.now_s += 0.01
        if polls <= failures:
            raise LineFault(quality, "b'..'")
        scripted.thread.stop()
        return [good(1.0, scripted.clock.now_s)]

    scripted = ScriptedThread(ScriptedGauge(poll))
    scripted.run()
    rests_s = [wait for wait in scripted.clock.waits_s if wait >= 0.05]
    assert rests_s == pytest.approx([0.1] if failures > MAX_FAILURES else [])
    assert scripted.lines[0].drained == (failures if quality is Quality.CRC else 0)


@pytest.mark.parametrize("quality", [Quality.TIMEOUT, Quality.INCOMPLETE, Quality.CRC, Quality.MISMATCH])
def test_a_good_reading_outlives_a_fault_of_the_wire(quality: Quality) -> None:
    scripted = polls_with_faults(None, LineFault(quality, "noise"), None)
    assert scripted.qualities("g0.c0") == [OK, OK]
    status = scripted.thread.status()["gauges"]["g0"]
    assert (status["polls"], status["ok"], status["faults"]) == (3, 2, {str(quality): 1})


def test_a_good_reading_goes_when_it_is_stale() -> None:
    missing = LineFault(Quality.TIMEOUT, "no byte")
    scripted = polls_with_faults(None, *[missing] * 7)
    (_, last), (_, first_missing), *_ = scripted.latest.history
    assert (last.quality, first_missing.quality) == (OK, Quality.TIMEOUT)
    assert first_missing.time_s - last.time_s > STALE_AFTER_S
    assert scripted.thread.gauges[0].faults[Quality.TIMEOUT] == 7
    assert len(scripted.latest.history) < 8, "the first of them took nothing away"


@pytest.mark.parametrize("quality", [Quality.DEVICE_ERROR, Quality.SILENT, Quality.SENSOR_FAULT, Quality.LINE_LOST])
def test_what_the_device_or_the_port_says_takes_a_reading_at_once(quality: Quality) -> None:
    scripted = polls_with_faults(None, LineFault(quality, "said so"))
    assert scripted.qualities("g0.c0") == [OK, quality]


@pytest.mark.parametrize(
    "answer",
    [
        ZeroDivisionError("a defect"),
        OwnError("an exception of the driver's own"),
        [],
        [good(1.0, 1.0), good(1.0, 1.0)],
        [Reading(math.nan, 1.0, OK)],
        [Reading(math.inf, 1.0, OK)],
        [Reading(1.0, math.nan, OK)],
        [Reading(1.0, 1e9, OK)],
        [None],
        None,
    ],
    ids=repr,
)
def test_a_defect_of_a_driver_is_named_logged_once_and_survived(answer: Any) -> None:
    polls = 0

    def poll() -> Any:
        nonlocal polls
        polls += 1
        if polls > 2:
            scripted.thread.stop()
            return [good(5.0, scripted.clock.now_s)]
        if isinstance(answer, Exception):
            raise answer
        return answer

    scripted = ScriptedThread(ScriptedGauge(poll))
    with structlog.testing.capture_logs() as logs:
        scripted.run()
    assert scripted.qualities("g0.c0") == [Quality.DRIVER_ERROR, Quality.DRIVER_ERROR, OK]
    assert len([entry for entry in logs if entry["event"] == "driver failed"]) == 1
    assert scripted.thread.status()["gauges"]["g0"]["faults"] == {"driver_error": 2}


def test_channels_of_one_poll_have_their_own_qualities() -> None:
    def poll() -> list[Reading]:
        scripted.thread.stop()
        now_s = scripted.clock.now_s
        return [good(1.0, now_s), Reading(math.nan, now_s, Quality.SENSOR_FAULT, "?"), good(math.inf, now_s)]

    scripted = ScriptedThread(ScriptedGauge(poll, channels=3))
    scripted.run()
    assert [scripted.qualities(f"g0.c{i}") for i in range(3)] == [[OK], [Quality.SENSOR_FAULT], [Quality.NOT_FINITE]]
    status = scripted.thread.status()["gauges"]["g0"]
    assert status["polls"] == 1
    assert status["ok"] == 0
    assert status["faults"] == {"sensor_fault": 1, "not_finite": 1}
    assert "last_ok_s" not in status


def test_rounds_keep_the_pace_that_is_configured() -> None:
    polls = 0

    def poll() -> list[Reading]:
        nonlocal polls
        polls += 1
        scripted.clock.now_s += 0.03
        if polls == 10:
            scripted.thread.stop()
        return [good(1.0, scripted.clock.now_s)]

    scripted = ScriptedThread(ScriptedGauge(poll), settings=SETTINGS_TCP.model_copy(update={"poll_every_s": 0.1}))
    scripted.run()
    assert scripted.clock.waits_s[:9] == pytest.approx([0.07] * 9)
    assert scripted.thread.status()["round_s"] == pytest.approx(0.03)
