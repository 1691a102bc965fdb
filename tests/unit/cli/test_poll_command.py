"""`compd gauge poll` beside a running daemon: a unit behind a gateway that is asked seldom, and has come back."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from compd.cli.app import app
from compd.cli.live.gauge.poll import gauge_status
from compd.client import connect
from compd.configuration import load
from compd.documents import read_document
from compd.operation_settings import SocketSettings, StateSettings
from tests.support.paths import CONFIG
from tests.support.patience import PATIENCE_S
from tests.support.running_daemon import supervised
from tests.support.serial_gateway import SerialGateway, serial_gateway

WATCH_HZ, MAX_SETPOINTS = 20.0, 400
UNITS, EXCHANGE_S, WAIT_S = 2, 0.001, 1.0
# The second poll that costs the other unit its reading: from then on it is asked every 100 s.
MISSES = 2


def with_gateway(directory: Path, gateway: SerialGateway) -> Path:
    """The shipped tripod with two units behind a gateway; its other lines have no device."""
    data = read_document(CONFIG / "tripod-cmm.yaml").data
    data["lines"]["rs485"] = {"kind": "modbus_tcp", "host": "127.0.0.1", "port": gateway.port, "timeout_s": 1.5}
    channel = {"name": "a", "function": 4, "address": 0, "type": "int16", "unit": "mm", "scale": 0.001}
    for unit in range(1, UNITS + 1):
        keys = {"driver": "modbus", "line": "rs485", "stale_after_s": 0.3, "unit": unit, "channels": [channel]}
        data["gauges"][f"unit_{unit}"] = keys
    path = directory / "machine.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return path


@pytest.mark.long
@pytest.mark.sample
def test_a_unit_that_has_come_back_is_asked_at_once(tmp_path: Path) -> None:
    with serial_gateway(UNITS, EXCHANGE_S, WAIT_S, exceptions=True) as gateway:
        loaded = load(with_gateway(tmp_path, gateway))
        socket = tmp_path / "s"
        configuration = replace(
            loaded,
            sockets=SocketSettings(tcp={"port": 0}, unix={"path": str(socket)}, valid_for_s=0.1),
            state=StateSettings(directory=str(tmp_path / "state")),
        )

        def poll(gauge: str) -> tuple[int, str]:
            result = CliRunner().invoke(app, ["gauge", "poll", gauge, "--daemon", str(socket)])
            return result.exit_code, result.output

        with supervised(configuration), connect(socket, PATIENCE_S) as client:
            watched = client.watch(WATCH_HZ)

            def until_polled(gauge: str, times: int, quality: str) -> None:
                for _ in islice(watched, MAX_SETPOINTS):
                    part = gauge_status(client.status(), gauge)
                    if part["faults"].get(quality, 0) >= times or (quality == "ok" and part["ok"] >= times):
                        return
                raise AssertionError(f"{gauge} was not polled: {client.status()['lines']['rs485']}")

            until_polled("unit_2", 1, "ok")
            gateway.dead.add(2)
            until_polled("unit_2", MISSES, "device_error")
            until_polled("unit_1", gauge_status(client.status(), "unit_1")["ok"] + 1, "ok")
            exit_code, output = poll("unit_2")
            assert (exit_code, output.split()[:2]) == (1, ["unit_2:", "device_error"])
            until_polled("unit_1", gauge_status(client.status(), "unit_1")["ok"] + 1, "ok")
            gateway.dead.clear()
            asked = gateway.asked[2]
            assert gauge_status(client.status(), "unit_2")["quality"] == "device_error"
            assert poll("unit_2") == (0, "unit_2: ok\n")
            assert gateway.asked[2] > asked
