"""Gauges that speak by themselves, from the command line and in the check of a configuration."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

import compd.configuration.line_checks
from compd.cli.app import app
from compd.commissioning.jump_trials import period_warnings
from compd.configuration import Configuration, load
from compd.documents import read_document
from compd.errors import ConfigurationError
from tests.support.mosquitto import needs_mosquitto, publisher, running_broker
from tests.support.paths import CONFIG

CHANNEL = "{name: value, topic: a, value: /v, time: /t, time_format: unix_s, unit: um}"


def with_joint(tmp_path: Path, line: dict[str, Any], gauge: dict[str, Any]) -> Configuration:
    """The shipped tripod whose first scale speaks by itself."""
    data = read_document(CONFIG / "tripod-cmm.yaml").data
    data["lines"]["scale_1"] = {"timeout_s": 1.0, **line}
    data["gauges"]["scale_1"] = {"line": "scale_1", "acceleration_mm_per_s2": 300, **gauge}
    (tmp_path / "machine.yaml").write_text(yaml.safe_dump(data))
    return load(tmp_path / "machine.yaml")


MQTT = {"kind": "mqtt", "host": "broker"}
TIMED = {"name": "value", "topic": "a", "value": "/v", "time": "/t", "unit": "mm"}
PLAIN = {"name": "value", "topic": "a", "unit": "mm"}
NODE = {"name": "value", "node": "ns=2;s=a", "unit": "mm"}


@needs_mosquitto
def test_read_and_watch_show_what_came(tmp_path: Path) -> None:
    with running_broker(tmp_path) as broker, publisher(broker) as device:
        arguments = ["mqtt", "--port", f"127.0.0.1:{broker.port}", "--timeout", "0.2", "--set", f"channels=[{CHANNEL}]"]
        silent = CliRunner().invoke(app, ["gauge", "read", *arguments])
        assert silent.exit_code == 1
        assert "timeout: nothing came on a" in silent.output
        device.publish("a", json.dumps({"v": 12.5, "t": time.time()}), retain=True)
        shown = CliRunner().invoke(app, ["gauge", "read", *arguments])
        assert shown.exit_code == 0
        assert 'b\'a {"v": 12.5' in shown.output
        assert "mqtt.value: 0.012500 mm" in shown.output
        watched = CliRunner().invoke(app, ["gauge", "watch", *arguments, "--polls", "1"])
        assert "0.012500 mm" in watched.output


def test_check_takes_them_and_warns_of_a_period_that_is_too_long(tmp_path: Path) -> None:
    good = with_joint(tmp_path, MQTT, {"driver": "mqtt", "channels": [TIMED]})
    assert period_warnings(good) == []
    shown = CliRunner().invoke(app, ["check", str(good.path)])
    assert shown.exit_code == 0, shown.output
    (slow,) = period_warnings(with_joint(tmp_path, MQTT, {"driver": "mqtt", "period_s": 5.0, "channels": [PLAIN]}))
    assert "a new value comes every 5 s" in str(slow)
    opc_ua = {"kind": "opc_ua", "endpoint": "opc.tcp://plc:4840", "publishing_s": 0.05}
    assert period_warnings(with_joint(tmp_path, opc_ua, {"driver": "opc_ua", "channels": [NODE]})) == []
    opc_ua["publishing_s"] = 2.0
    (slow,) = period_warnings(with_joint(tmp_path, opc_ua, {"driver": "opc_ua", "channels": [NODE]}))
    assert "`publishing_s`" in str(slow)


@pytest.mark.parametrize(
    ("line", "gauge", "said"),
    [
        (MQTT, {"driver": "mqtt", "channels": [PLAIN]}, "`period_s` is needed"),
        (MQTT, {"driver": "mqtt", "time_from": "arrival", "channels": [TIMED]}, "`period_s` is needed"),
        (MQTT, {"driver": "mqtt", "period_s": 1, "channels": [{**PLAIN, "topic": "a/#"}]}, "wildcards"),
        (MQTT, {"driver": "mqtt", "period_s": 1, "channels": [{**PLAIN, "time": "/t"}]}, "where the number is"),
        (MQTT, {"driver": "mqtt", "period_s": 1, "channels": [{**TIMED, "value": "v"}]}, "value"),
        (MQTT, {"driver": "opc_ua", "channels": [NODE]}, "needs a line that carries nodes"),
        ({**MQTT, "password_file": "/x"}, {"driver": "mqtt", "channels": [TIMED]}, "without a `user`"),
        (
            {"kind": "opc_ua", "endpoint": "plc:4840"},
            {"driver": "opc_ua", "channels": [NODE]},
            "endpoint",
        ),
        (
            {"kind": "opc_ua", "endpoint": "opc.tcp://plc:4840"},
            {"driver": "opc_ua", "channels": [{**NODE, "node": "Probe1"}]},
            "node",
        ),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, line: dict[str, Any], gauge: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        with_joint(tmp_path, line, gauge)


def test_a_library_that_is_missing_is_named_with_what_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compd.configuration.line_checks, "find_spec", lambda name: None)
    with pytest.raises(ConfigurationError, match=r"pip install 'compd\[mqtt\]'"):
        with_joint(tmp_path, MQTT, {"driver": "mqtt", "channels": [TIMED]})
