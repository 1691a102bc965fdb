"""The daemon with scales on OPC UA and MQTT: setpoints, and a server or broker that goes and comes back."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
import yaml

from compd.demo.machine_zero import wait_for_gauges
from compd.demo.processes import Command, run_commands
from compd.documents import read_document
from compd.simulation import ControlClient
from tests.support.daemon_process import Daemon
from tests.support.mosquitto import Broker, needs_mosquitto, publisher, running_broker
from tests.support.paths import CONFIG
from tests.support.processes import takes_zero
from tests.support.simulated import PATIENT_TIP_ERROR_UM, run_directory
from tests.support.watching import Watcher, until

MACHINE = "tripod-cmm.yaml"
RATE_HZ = 100.0
BACK_OFF_S = [0.2, 0.5]
# The machine stands still: so far setpoints may be apart before and after a fault, for the gauges' noise.
AT_REST_MM = 0.01


def with_scales(directory: Path, line: dict[str, Any], driver: str, address: dict[str, Any]) -> Path:
    """The shipped tripod with its three scales on one line; `address` with the place of their number in it."""
    data = read_document(CONFIG / MACHINE).data
    for number in (1, 2, 3):
        scale = f"scale_{number}"
        del data["lines"][scale]
        placed = {key: str(value).format(number) for key, value in address.items()}
        data["gauges"][scale] = {
            "driver": driver,
            "line": "scales",
            "acceleration_mm_per_s2": 300,
            "noise_um": 0.03,
            "channels": [{"name": "position", "unit": "mm", **placed}],
        }
    data["lines"]["scales"] = {"timeout_s": 2.0, "back_off_s": BACK_OFF_S, **line}
    data["limits"]["tip_error_um"] = PATIENT_TIP_ERROR_UM
    path = directory / MACHINE
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return path


@contextmanager
def machine_and_daemon(directory: Path, machine: Path, *options: str) -> Iterator[tuple[Daemon, Path]]:
    """The simulated machine at rest, the daemon for it with machine zero taken, and the machine's control socket."""
    wires = directory / "wires"
    control = wires / "control.sock"
    simulate = ["sim", "run", str(machine), "--directory", str(wires), "--seed", "3", "--zero-hold", "3600", *options]
    with run_commands([Command(simulate, ready=control)], log=directory / "simulate.log"):
        data = yaml.safe_load((wires / MACHINE).read_text())
        data["loop"]["rate_hz"] = RATE_HZ
        data["sockets"] = {"unix": {"path": str(directory / "s")}, "valid_for_s": 0.1}
        data["state"] = {"directory": str(directory / "state")}
        config = directory / "daemon.yaml"
        config.write_text(yaml.safe_dump(data, sort_keys=False))
        with Daemon(config) as daemon:
            with daemon.connected() as client:
                wait_for_gauges(client, client.watch(10))
                until("machine zero is taken", lambda: takes_zero(client))
            yield daemon, control


def check_outage(daemon: Daemon, watcher: Watcher, begin: Any, end: Any) -> None:
    """Ok, then no value for the scales, then ok again where a person has looked: they show zero, as before.

    There is no setpoint in between that is of another place.
    """
    before = watcher.until("ok", lambda seen: seen["state"] == "ok", watcher.now)
    since = watcher.now
    begin()
    until("the line is lost", lambda: daemon.quality("scale_1.position") == "line_lost")
    watcher.until("not ok", lambda seen: seen["state"] != "ok", since)
    end()
    until("a person is asked", lambda: daemon.quality("scale_1.position") == "distrusted")
    with daemon.connected() as client:
        client.accept("all")
    until("the scale is good", lambda: daemon.quality("scale_1.position") == "ok")
    watcher.until("ok", lambda seen: seen["state"] == "ok", watcher.now)
    valid = [seen for seen in watcher.seen[since:] if seen["valid"]]
    assert all(
        abs(now - then) < AT_REST_MM
        for seen in valid
        for now, then in zip(seen["tip_M_mm"], before["tip_M_mm"], strict=True)
    )


@needs_mosquitto
def test_a_broker_that_dies_and_is_started_again() -> None:
    address = {"topic": "cell/scale_{}", "value": "/mm", "time": "/t"}
    with run_directory() as directory, running_broker(directory) as broker:
        machine = with_scales(directory, {"kind": "mqtt", "host": "127.0.0.1", "port": broker.port}, "mqtt", address)
        here = f"127.0.0.1:{broker.port}"
        with machine_and_daemon(directory, machine, "--broker", here) as (daemon, _), daemon.watched() as watcher:

            def come_back_with_an_old_value() -> None:
                """Retained before the daemon or the scales are there again: an hour old, and 99 mm away."""
                broker.start()
                keep_old_value(broker)

            check_outage(daemon, watcher, broker.kill, come_back_with_an_old_value)


def keep_old_value(broker: Broker) -> None:
    when = datetime.fromtimestamp(time.time() - 3600.0, UTC).isoformat()
    with publisher(broker) as gateway:
        gateway.publish("cell/scale_1", json.dumps({"mm": 99.0, "t": when}), retain=True)


@pytest.mark.long
def test_a_server_that_stops_and_is_started_again() -> None:
    line = {"kind": "opc_ua", "endpoint": "opc.tcp://192.0.2.1:4840"}
    with run_directory() as directory:
        machine = with_scales(directory, line, "opc_ua", {"node": "ns=2;s=scale_{}"})
        with (
            machine_and_daemon(directory, machine) as (daemon, control),
            ControlClient(control) as simulation,
            daemon.watched() as watcher,
        ):

            def fault(name: str | None) -> None:
                simulation.ask("FAULT", line="scales", fault=name)

            check_outage(daemon, watcher, lambda: fault("unplugged"), lambda: fault(None))
            since = watcher.now
            fault("bad status")
            until("the status is seen", lambda: daemon.quality("scale_1.position") == "device_error")
            watcher.until("not ok", lambda seen: seen["state"] != "ok", since)
            fault(None)
            watcher.until("ok", lambda seen: seen["state"] == "ok", watcher.now)
