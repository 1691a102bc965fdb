"""The simulated machine's gauges on OPC UA and MQTT, read by the gauges for which they stand in."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from structlog.testing import capture_logs

from compd.clock import MonotonicClock
from compd.errors import CompdError
from compd.gauge import Quality
from compd.lines.kinds.mqtt.twin import MqttPublisher
from compd.lines.kinds.opc_ua.twin import OpcUaNodes
from compd.plugins import SIMULATED_GAUGES, load
from compd.twins import SimulatedPushedLine
from tests.support.mosquitto import needs_mosquitto, running_broker
from tests.support.pushed_gauges import acquiring, gauge
from tests.support.sampled import sampled

# A twin publishes time and again: what is too old by the time it comes is followed by what is not.
STALE_AFTER_S = 0.5
VALUES = {"a": 1.25, "b": -0.5, "off": math.nan}
NODES = [
    {"name": "a", "node": "nsu=urn:probes;s=a", "unit": "um", "scale": 0.5},
    {"name": "b", "node": "ns=3;s=all", "index": 1, "unit": "mm"},
    {"name": "off", "node": "ns=2;i=7", "unit": "mm"},
]
TOPICS = [
    {"name": "a", "topic": "a", "unit": "um", "scale": 0.5},
    {
        "name": "b",
        "topic": "all",
        "value": "/probes/1/mm",
        "unit": "mm",
        "time": "/t",
        "time_format": "unix_ms",
        "status": {"at": "/state", "ok": ["fine"]},
    },
    {"name": "off", "topic": "off", "value": "/v", "unit": "mm"},
]


def check(line: dict[str, Any], measured: Any, twin: SimulatedPushedLine) -> None:
    """Its values, its faults, and its end."""
    with acquiring(line, {"g": measured}, stale_after_s=2.0) as (acquisition, latest):
        for name in ("a", "b"):
            assert latest.wait_for(f"g.{name}", Quality.OK).value == pytest.approx(VALUES[name])
        assert latest.wait_for("g.off", Quality.SENSOR_FAULT).detail
        since = latest.now
        twin.fault = "silent"
        latest.wait_for("g.b", Quality.TIMEOUT, since)
        twin.fault = None
        since = latest.now
        latest.wait_for("g.b", Quality.OK, since)
        with pytest.raises(ValueError, match="no fault 'upside down'"):
            twin.fault = "upside down"
        assert acquisition.status()["l"]["state"] == "open"


def device(driver: str, options: Any) -> Any:
    return load(SIMULATED_GAUGES, driver, driver)(options, lambda channel: VALUES[channel])


@pytest.mark.long
def test_an_opc_ua_server_with_the_nodes_of_its_gauges() -> None:
    measured = gauge("opc_ua", channels=NODES)
    twin = OpcUaNodes("l", [device("opc_ua", measured.options)])
    endpoint = twin.start()
    try:
        check({"kind": "opc_ua", "endpoint": endpoint}, measured, twin)
    finally:
        twin.stop()


@pytest.mark.long
def test_a_server_that_stops_under_its_clients_leaves_nothing_that_waits(caplog: pytest.LogCaptureFixture) -> None:
    measured = gauge("opc_ua", channels=NODES)
    twin = OpcUaNodes("l", [device("opc_ua", measured.options)])
    line = {"kind": "opc_ua", "endpoint": twin.start()}
    with acquiring(line, {"g": measured}) as (_, latest):
        latest.wait_for("g.a", Quality.OK)
        twin.stop()
        latest.wait_for("g.a", Quality.LINE_LOST)
    del twin
    gc.collect()
    assert [record.getMessage() for record in caplog.records if record.name == "asyncio"] == []


@pytest.mark.long
@needs_mosquitto
def test_a_publisher_on_the_topics_of_its_gauges(tmp_path: Path) -> None:
    measured = gauge("mqtt", channels=TOPICS, period_s=1.0)
    with running_broker(tmp_path) as broker:
        twin = MqttPublisher("l", [device("mqtt", measured.options)], ("127.0.0.1", broker.port))
        host, port = twin.start()
        try:
            check({"kind": "mqtt", "host": host, "port": port}, measured, twin)
        finally:
            twin.stop()


# What compd delivers of `a`, a plain number that does not stand still, and of `b`, which has a time.
CHANNEL_B = {"name": "b", "topic": "b", "value": "/v", "unit": "mm", "time": "/t"}


def rising() -> Callable[[str], float]:
    """Sensors that never show the same twice."""
    values = count(1.0, 1e-4)
    return lambda channel: next(values)


@pytest.fixture(scope="module")
def opc_ua_twin() -> Iterator[tuple[dict[str, Any], SimulatedPushedLine]]:
    """With one node; it takes seconds to start."""
    twin = OpcUaNodes("l", [load(SIMULATED_GAUGES, "opc_ua", "opc_ua")(node_gauge().options, rising())])
    endpoint = twin.start()
    try:
        yield {"kind": "opc_ua", "endpoint": endpoint, "publishing_s": 0.02}, twin
    finally:
        twin.stop()


def node_gauge() -> Any:
    return gauge("opc_ua", channels=[{"name": "b", "node": "ns=2;s=b", "unit": "mm"}])


@contextmanager
def mqtt_twin(directory: Path, **channel: Any) -> Iterator[tuple[dict[str, Any], Any, SimulatedPushedLine]]:
    measured = gauge("mqtt", channels=[channel], period_s=0.1)
    with running_broker(directory) as broker:
        simulated = load(SIMULATED_GAUGES, "mqtt", "mqtt")(measured.options, rising())
        twin = MqttPublisher("l", [simulated], ("127.0.0.1", broker.port))
        host, port = twin.start()
        try:
            yield {"kind": "mqtt", "host": host, "port": port}, measured, twin
        finally:
            twin.stop()


def check_fault(
    twin: SimulatedPushedLine, line: dict[str, Any], measured: Any, fault: str, qualities: set[Quality], channel: str
) -> None:
    """With the fault the channel gets one of these qualities and no value that is not of now; then it is good again."""
    with acquiring(line, {"g": measured}, stale_after_s=STALE_AFTER_S) as (_, latest):
        latest.wait_for(channel, Quality.OK)
        twin.fault = fault
        first = next(r for r in iter(lambda: latest.wait_for_any(channel, latest.now), None) if r.quality in qualities)
        assert math.isnan(first.value)
        begun_s, ends = MonotonicClock().monotonic(), latest.now
        twin.fault = None
        good = latest.wait_for(channel, Quality.OK, ends)
        assert good.time_s > begun_s - STALE_AFTER_S, "an old value counts as a new one"
        values = [r.value for name, r in latest.history if name == channel and r.ok]
        assert values == sorted(values), "an old value came after a newer one"


SILENCE = {Quality.TIMEOUT, Quality.STALE}
LATE = {Quality.STALE, Quality.MISMATCH, Quality.TIMEOUT}


@pytest.mark.parametrize(
    ("fault", "qualities"),
    sampled(
        [
            ("bad status", {Quality.DEVICE_ERROR}),
            ("uncertain status", {Quality.STALE}),
            ("wrong type", {Quality.MISMATCH}),
            ("clock stuck", SILENCE),
            ("clock behind", LATE),
            ("held up", SILENCE),
            ("unplugged", {Quality.LINE_LOST}),
        ],
        3,
    ),
)
def test_faults_of_nodes(
    opc_ua_twin: tuple[dict[str, Any], SimulatedPushedLine], fault: str, qualities: set[Quality]
) -> None:
    line, twin = opc_ua_twin
    assert fault in twin.faults
    check_fault(twin, line, node_gauge(), fault, qualities, "g.b")


@needs_mosquitto
@pytest.mark.parametrize(
    ("fault", "qualities"),
    sampled(
        [
            ("not a number", {Quality.MISMATCH}),
            ("wrong type", {Quality.MISMATCH}),
            ("clock stuck", SILENCE),
            ("clock behind", LATE),
            ("held up", SILENCE),
            ("unplugged", {Quality.TIMEOUT}),
        ],
        3,
    ),
)
def test_faults_of_documents(tmp_path: Path, fault: str, qualities: set[Quality]) -> None:
    with mqtt_twin(tmp_path, **CHANNEL_B) as (line, measured, twin):
        assert fault in twin.faults
        check_fault(twin, line, measured, fault, qualities, "g.b")


@needs_mosquitto
@pytest.mark.parametrize("fault", ["not a number", "wrong type", "held up"])
def test_faults_of_plain_numbers(tmp_path: Path, fault: str) -> None:
    qualities = SILENCE if fault == "held up" else {Quality.MISMATCH}
    with mqtt_twin(tmp_path, name="a", topic="a", unit="mm") as (line, measured, twin):
        check_fault(twin, line, measured, fault, qualities, "g.a")


def check_clock_ahead(twin: SimulatedPushedLine, line: dict[str, Any], measured: Any) -> None:
    """The arrival counts, and the log says so; no reading is of the future, and none stays when the clock is right."""
    with acquiring(line, {"g": measured}) as (_, latest):
        latest.wait_for("g.b", Quality.OK)
        with capture_logs() as logs:
            twin.fault = "clock ahead"
            while not any("ahead" in entry.get("detail", "") for entry in logs):
                latest.wait_for_any("g.b", latest.now)
        reading = latest.wait_for("g.b", Quality.OK, latest.now)
        assert reading.time_s <= MonotonicClock().monotonic()
        twin.fault = None
        assert latest.wait_for("g.b", Quality.OK, latest.now).value > reading.value


def test_a_node_whose_clock_is_ahead(opc_ua_twin: tuple[dict[str, Any], SimulatedPushedLine]) -> None:
    line, twin = opc_ua_twin
    check_clock_ahead(twin, line, node_gauge())


@needs_mosquitto
def test_a_document_whose_clock_is_ahead(tmp_path: Path) -> None:
    with mqtt_twin(tmp_path, **CHANNEL_B) as (line, measured, twin):
        check_clock_ahead(twin, line, measured)


def test_without_a_broker_nothing_is_published() -> None:
    with pytest.raises(CompdError, match="--broker"):
        MqttPublisher("l", [], None)
