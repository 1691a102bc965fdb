"""The simulated machine's gauges on OPC UA and MQTT, read by the gauges for which they stand in."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from compd.errors import CompdError
from compd.gauge import Quality
from compd.plugins import SIMULATED_GAUGES, load
from compd.simulation.wires.mqtt_publisher import MqttPublisher
from compd.simulation.wires.opc_ua_server import OpcUaNodes
from compd.simulation.wires.pushed_line import SimulatedPushedLine
from tests.support.mosquitto import needs_mosquitto, running_broker
from tests.support.pushed_gauges import acquiring, gauge

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


def test_an_opc_ua_server_with_the_nodes_of_its_gauges() -> None:
    measured = gauge("opc_ua", channels=NODES)
    twin = OpcUaNodes("l", [device("opc_ua", measured.options)])
    endpoint = twin.start()
    try:
        check({"kind": "opc_ua", "endpoint": endpoint}, measured, twin)
    finally:
        twin.stop()


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


def test_without_a_broker_nothing_is_published() -> None:
    with pytest.raises(CompdError, match="--broker"):
        MqttPublisher("l", [], None)
