"""MQTT from a real broker to the slots of the readings: the same qualities as from polled lines, and honest times."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from structlog.testing import capture_logs

from compd.gauge import Gauge, Quality
from compd.live.acquisition.possible_motion import MotionLimits
from compd.live.acquisition.reading_trust import ReadingTrust, TrustSettings
from compd.live.memory.trust_memory import TrustMemory
from compd.source_time import SAME_TIME_S
from tests.support.hand_clock import SteppedClock
from tests.support.mosquitto import Broker, Publisher, needs_mosquitto, publisher, running_broker
from tests.support.pushed_gauges import STALE_AFTER_S, acquiring, gauge
from tests.support.watching import until

pytestmark = needs_mosquitto
OK = Quality.OK


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    with running_broker(tmp_path) as started:
        yield started


@pytest.fixture
def device(broker: Broker) -> Iterator[Publisher]:
    with publisher(broker) as connected:
        yield connected


def line_to(broker: Broker, **keys: Any) -> dict[str, Any]:
    return {"kind": "mqtt", "host": "127.0.0.1", "port": broker.port, **keys}


def plain(**keys: Any) -> Gauge[Any]:
    channel = {"name": "a", "topic": "a", "unit": "mm", **keys}
    return gauge("mqtt", period_s=60.0, channels=[channel])


def timed(**keys: Any) -> Gauge[Any]:
    return plain(value="/v", time="/t", **keys)


def payload(value: Any, age_s: float = 0.0, now_utc_s: float | None = None) -> str:
    """now_utc_s : None for now, s since 1970."""
    when = datetime.fromtimestamp((time.time() if now_utc_s is None else now_utc_s) - age_s, UTC)
    return json.dumps({"v": value, "t": when.isoformat()})


# Of a value that is not too old, and far from new.
AGE_S = STALE_AFTER_S / 2


def check_time(time_s: float, before_s: float) -> None:
    """A reading of a source that measured it `AGE_S` before a moment between the monotonic `before_s` and now.

    Where the line's thread is held up between two looks at its clocks, the reading is older by that.
    """
    assert before_s - STALE_AFTER_S < time_s <= time.monotonic() - AGE_S + SAME_TIME_S


@contextmanager
def listening(
    broker: Broker, device: Publisher, measured: Gauge[Any], line: dict[str, Any] | None = None, **keys: Any
) -> Iterator[tuple[Any, Any]]:
    """The line's thread with one gauge, subscribed: it has heard what the broker had kept, which is no value.

    line : further keys of the line. keys : of `acquiring`.
    """
    for topic in measured.addresses:  # type: ignore[attr-defined]
        device.publish(topic, "null", retain=True)
    with acquiring(line_to(broker, **(line or {})), {"g": measured}, **keys) as (acquisition, latest):
        for channel in latest.channels:
            latest.wait_for_any(channel)
        yield acquisition, latest


def pass_time(clock: SteppedClock, step_s: float) -> None:
    """Let `step_s` pass while the line's thread looks for messages: the next one has come afterwards."""
    clock.step(step_s)
    reads = clock.reads
    until("the line has looked again and again", lambda: clock.reads > reads + 20)


def gauge_status(acquisition: Any) -> dict[str, Any]:
    return acquisition.status()["l"]["gauges"]["g"]  # type: ignore[no-any-return]


def test_a_plain_number_is_read_in_its_unit(broker: Broker, device: Publisher) -> None:
    with listening(broker, device, plain(unit="um", range=[-1, 1])) as (acquisition, latest):
        for text, value in (("12.5", 0.0125), ("-3e1\n", -0.03)):
            since, before_s = latest.now, time.monotonic()
            device.publish("a", text)
            reading = latest.wait_for("g.a", OK, since)
            assert reading.value == pytest.approx(value)
            assert before_s - STALE_AFTER_S < reading.time_s <= time.monotonic()
        device.publish("a", "1234.5")
        latest.wait_for("g.a", Quality.OVER_RANGE)
        assert acquisition.status()["l"]["state"] == "open"


@pytest.mark.parametrize(
    ("sent", "quality"),
    [
        ("nan", Quality.NOT_FINITE),
        ("-Infinity", Quality.NOT_FINITE),
        ("1e999", Quality.NOT_FINITE),
        ("", Quality.MISMATCH),
        ("offline", Quality.MISMATCH),
        ("12,5", Quality.MISMATCH),
        ("1_000", Quality.MISMATCH),
        ("0x10", Quality.MISMATCH),
        ("12.5 mm", Quality.MISMATCH),
        ('{"v": 1}', Quality.MISMATCH),
        ("\u0661\u0662", Quality.MISMATCH),  # Arabic digits, which Python's float takes
    ],
)
def test_a_payload_that_is_no_number_has_a_name_and_no_value(
    broker: Broker, device: Publisher, sent: str, quality: Quality
) -> None:
    with listening(broker, device, plain()) as (_, latest):
        since = latest.now
        device.publish("a", sent)
        assert math.isnan(latest.wait_for("g.a", quality, since).value)


@pytest.mark.parametrize(
    ("document", "quality"),
    [
        ({"v": None}, Quality.SENSOR_FAULT),
        ({"v": "1.5"}, Quality.MISMATCH),
        ({"v": True}, Quality.MISMATCH),
        ({"v": [1.5]}, Quality.MISMATCH),
        ({"w": 1.5}, Quality.MISMATCH),
        ({"v": math.nan}, Quality.NOT_FINITE),
        ({"v": 10**400}, Quality.NOT_FINITE),
    ],
)
def test_a_document_without_a_number_at_its_path(
    broker: Broker, device: Publisher, document: dict[str, Any], quality: Quality
) -> None:
    with listening(broker, device, timed()) as (_, latest):
        since = latest.now
        device.publish("a", json.dumps({"t": datetime.now(UTC).isoformat(), **document}))
        assert math.isnan(latest.wait_for("g.a", quality, since).value)


@pytest.mark.parametrize(
    "when", [None, "2026-11-23T18:00:00", "now", 12, "", "1970-01-01T00:00:05Z", "9999-12-31T23:59:59Z", True]
)
def test_a_value_without_a_time_is_never_used(broker: Broker, device: Publisher, when: Any) -> None:
    with listening(broker, device, timed()) as (_, latest):
        since = latest.now
        device.publish("a", json.dumps({"v": 1.5} if when is None else {"v": 1.5, "t": when}))
        assert "no time" in (detail := latest.wait_for("g.a", Quality.MISMATCH, since).detail) or "nothing at" in detail


def test_the_time_is_that_of_the_source(broker: Broker, device: Publisher) -> None:
    with listening(broker, device, timed()) as (_, latest):
        since, before_s = latest.now, time.monotonic()
        device.publish("a", payload(1.5, age_s=AGE_S))
        check_time(latest.wait_for("g.a", OK, since).time_s, before_s)


@pytest.mark.parametrize(("form", "unit_s"), [("unix_s", 1), ("unix_ms", 1e-3), ("unix_us", 1e-6), ("unix_ns", 1e-9)])
def test_times_as_numbers(broker: Broker, device: Publisher, form: str, unit_s: float) -> None:
    with listening(broker, device, timed(time_format=form)) as (_, latest):
        since, before_s = latest.now, time.monotonic()
        device.publish("a", json.dumps({"v": 1.5, "t": (time.time() - AGE_S) / unit_s}))
        check_time(latest.wait_for("g.a", OK, since).time_s, before_s)


def test_an_old_value_is_stale_however_it_comes(broker: Broker, device: Publisher) -> None:
    with listening(broker, device, timed()) as (acquisition, latest):
        device.publish("a", payload(1.5, age_s=3600))
        reading = latest.wait_for("g.a", Quality.STALE)
        assert "measured 3.6e+03 s ago" in reading.detail
        assert gauge_status(acquisition)["quality"] == "stale"
        assert not any(r.ok for _, r in latest.history)


def test_a_clock_that_is_ahead_gives_way_to_the_arrival_and_is_named(broker: Broker, device: Publisher) -> None:
    with capture_logs() as logs, listening(broker, device, timed()) as (_, latest):
        for value in (1.5, 1.6):
            since, before_s = latest.now, time.monotonic()
            device.publish("a", payload(value, age_s=-3600))
            reading = latest.wait_for("g.a", OK, since)
            assert before_s - STALE_AFTER_S < reading.time_s <= time.monotonic(), "never in the future"
    clocks = [entry for entry in logs if entry["event"] == "clock of a source"]
    assert len(clocks) == 1, "once, not with every value"
    assert "3.6e+03 s ahead" in clocks[0]["detail"]


def test_out_of_order_and_repeated_values_change_nothing(broker: Broker, device: Publisher) -> None:
    with listening(broker, device, timed()) as (acquisition, latest):
        newest = payload(1.5, age_s=0.05)
        device.publish("a", newest)
        kept = latest.wait_for("g.a", OK)
        device.publish("a", payload(99.0, age_s=0.2))  # was under way for longer
        device.publish("a", newest)  # a second copy
        since = latest.now
        device.publish("a", payload(1.7))
        assert latest.wait_for("g.a", OK, since).value == 1.7
        assert {r.value for _, r in latest.history if r.ok} == {1.5, 1.7}
        assert kept.value == 1.5
        assert gauge_status(acquisition)["faults"]["mismatch"] >= 1, "the late one is counted"


def test_what_the_broker_kept_is_not_now(broker: Broker, device: Publisher) -> None:
    device.publish("a", "1.5", retain=True)
    with acquiring(line_to(broker), {"g": plain()}) as (_, latest):
        assert "nobody knows how old" in latest.wait_for("g.a", Quality.STALE).detail
        since = latest.now
        device.publish("a", "1.6", retain=True)
        assert latest.wait_for("g.a", OK, since).value == 1.6
    device.publish("a", payload(1.5, age_s=0.1), retain=True)
    with acquiring(line_to(broker), {"g": timed()}) as (_, latest):
        assert latest.wait_for("g.a", OK).value == 1.5, "its own time says that it is new"


def test_silence_becomes_a_timeout_while_the_connection_is_up(broker: Broker, device: Publisher) -> None:
    clock = SteppedClock()
    with listening(broker, device, timed(), clock=clock) as (acquisition, latest):
        device.publish("a", payload(1.5))
        latest.wait_for("g.a", OK)
        pass_time(clock, 1.01 * STALE_AFTER_S)
        reading = latest.wait_for("g.a", Quality.TIMEOUT)
        assert f"nothing new on a for {STALE_AFTER_S:g} s" in reading.detail
        assert acquisition.status()["l"]["state"] == "open"
        since = latest.now
        device.publish("a", payload(1.6))
        assert latest.wait_for("g.a", OK, since).value == 1.6


def test_two_topics_of_one_gauge_do_not_wait_for_each_other(broker: Broker, device: Publisher) -> None:
    both = gauge(
        "mqtt",
        channels=[{"name": n, "topic": n, "value": "/v", "time": "/t", "unit": "mm"} for n in ("a", "b")],
    )
    clock = SteppedClock()
    with listening(broker, device, both, clock=clock) as (_, latest):
        device.publish("a", payload(1.0))
        assert latest.wait_for("g.a", OK).value == 1.0
        device.publish("b", payload(2.0))
        assert latest.wait_for("g.b", OK).value == 2.0
        since = latest.now
        while not any(n == "g.a" and r.quality is Quality.TIMEOUT for n, r in latest.history[since:]):
            pass_time(clock, STALE_AFTER_S / 4)
            published = latest.now
            device.publish("b", payload(2.0))
            latest.wait_for_any("g.b", published)
        assert not any(n == "g.b" and not r.ok for n, r in latest.history[since:]), "b is not silent"


def test_channels_out_of_one_document(broker: Broker, device: Publisher) -> None:
    document = {"topic": "all", "time": "/t", "time_format": "unix_s", "unit": "mm"}
    channels = [
        {"name": "a", "value": "/probes/0/x~1y", **document},
        {"name": "b", "value": "/probes/1/x~1y", "status": {"at": "/state", "ok": ["ok"]}, **document},
    ]
    both = gauge("mqtt", channels=channels)
    with listening(broker, device, both) as (_, latest):
        sent = {"t": time.time(), "probes": [{"x/y": 1.0}, {"x/y": 2}], "state": "ok"}
        device.publish("all", json.dumps(sent))
        assert (latest.wait_for("g.a", OK).value, latest.wait_for("g.b", OK).value) == (1.0, 2.0)
        device.publish("all", json.dumps({**sent, "t": time.time(), "state": "warming up"}))
        assert "warming up" in latest.wait_for("g.b", Quality.DEVICE_ERROR).detail


def good_then(device: Publisher, latest: Any) -> int:
    """Deliver a good value; what comes after the returned history entry is new."""
    device.publish("a", payload(1.5), retain=True)  # for a line that is just being opened anew, too
    latest.wait_for("g.a", OK)
    return int(latest.now)


def test_a_broker_that_is_killed_is_a_lost_line_until_it_is_back(broker: Broker, device: Publisher) -> None:
    with listening(broker, device, timed()) as (acquisition, latest):
        since = good_then(device, latest)
        broker.kill()
        assert math.isnan(latest.wait_for("g.a", Quality.LINE_LOST, since).value)
        assert acquisition.status()["l"]["state"] == "lost"
        broker.start()
        with publisher(broker) as again:
            again.publish("a", payload(1.6), retain=True)  # kept for a line that is not there yet
            assert latest.wait_for("g.a", OK, since).value == 1.6
        assert acquisition.status()["l"]["state"] == "open"


def test_what_a_broker_had_kept_is_not_now_when_it_is_back(tmp_path: Path) -> None:
    keeps = f"allow_anonymous true\npersistence true\npersistence_location {tmp_path}/\n"
    with (
        running_broker(tmp_path, keeps) as broker,
        publisher(broker) as device,
        listening(broker, device, plain()) as (acquisition, latest),
    ):
        since = latest.now
        device.publish("a", "1.5", retain=True)
        assert latest.wait_for("g.a", OK, since).value == 1.5
        since = latest.now
        broker.stop()
        latest.wait_for("g.a", Quality.LINE_LOST, since)
        since = latest.now
        broker.start()
        assert "nobody knows how old" in latest.wait_for("g.a", Quality.STALE, since).detail
        assert acquisition.status()["l"]["state"] == "open"
        with publisher(broker) as again:
            again.publish("a", "1.6")
            assert latest.wait_for("g.a", OK, since).value == 1.6
        assert not any(reading.value == 1.5 for _, reading in latest.history[since:])


def test_a_broker_that_stands_still_is_lost(broker: Broker, device: Publisher) -> None:
    with listening(broker, device, timed(), {"keep_alive_s": 1}) as (_, latest):
        since = good_then(device, latest)
        broker.pause()
        assert "Keep alive" in latest.wait_for("g.a", Quality.LINE_LOST, since).detail
        broker.go_on()


def test_one_damaged_length_is_not_believed_and_two_that_agree_are(broker: Broker, device: Publisher) -> None:
    memory = TrustMemory(["g.a"], [0.001])
    judge = ReadingTrust(memory, "g.a", TrustSettings(MotionLimits(acceleration=1.0), False, 30.0, restart_s=0.5))
    with listening(broker, device, timed(), trust={"g.a": judge}) as (_, latest):
        now_utc_s = time.time()

        def publish(value: float, age_s: float) -> None:
            """Measured so long before one moment, whenever it is sent: of a part whose speed is known."""
            device.publish("a", payload(value, age_s, now_utc_s))

        for age_s in (0.8, 0.7, 0.6):
            publish(1.0, age_s)
        latest.wait_for("g.a", OK)
        publish(5.0, 0.5)  # damaged on its way: nobody can ask again
        publish(1.0001, 0.4)
        publish(1.0002, 0.3)
        latest.wait_for_value("g.a", 1.0002)
        assert 5.0 not in {r.value for _, r in latest.history}
        publish(5.0, 0.2)
        publish(5.0, 0.1)
        assert "jumped by 4.000 mm" in latest.wait_for("g.a", Quality.DISTRUSTED).detail
