"""Nine units on one line of a simulated machine, on real ptys: apart without a round trigger, at once with one."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
import yaml

from compd.client import connect
from compd.clock import MonotonicClock
from compd.configuration import Configuration, load
from compd.documents import read_document
from compd.simulation import Simulation, World
from tests.support.paths import CONFIG
from tests.support.running_daemon import supervised
from tests.support.simulated import run_directory

UNITS = range(1, 10)
TRIGGER = {"function": 5, "address": 7, "values": [1], "settle_s": 0.002}
# READINGS with all nine that are looked at, and those that may come before.
WHOLE, AT_MOST = 100, 4000


def nine_units(directory: Path, **line: Any) -> Configuration:
    """The shipped tripod with its joint comparators as nine units on one Modbus line."""
    data = read_document(CONFIG / "tripod-cmm.yaml").data
    data["lines"]["joints"] = {"kind": "modbus_rtu", "port": "/dev/x", "baud": 19200, "format": "8N1", "timeout_s": 0.5}
    data["lines"]["joints"] |= line
    del data["gauges"]["joints"]
    channel = {"name": "v", "function": 4, "address": 0, "type": "float32", "unit": "mm"}
    for unit, wire in zip(UNITS, data["wiring"]["joint"], strict=True):
        wire["gauge"] = f"j{unit}"
        data["gauges"][f"j{unit}"] = {"driver": "modbus", "line": "joints", "unit": unit, "channels": [channel]}
    data["loop"] |= {"rate_hz": 50, "stale_after_s": 5.0}
    path = directory / "machine.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return load(path)


def samplings(configuration: Configuration, directory: Path) -> tuple[list[int], dict[str, Any]]:
    """At how many times the nine units were measured, for READINGS that have all nine; and a STATUS."""
    clock = MonotonicClock()
    world = World(configuration.geometry, configuration.wiring, 3, zero_hold_s=0.0)
    simulation = Simulation(configuration, world, directory, clock)
    daemon = simulation.start()
    try:
        with supervised(daemon), connect(daemon.sockets.unix.path) as client:
            times = []
            for number, (_, message) in enumerate(client.readings()):
                assert number < AT_MOST, "the nine units never answer"
                readings = [message.get("readings", {}).get(f"j{unit}.v", {}) for unit in UNITS]
                if all("value" in reading for reading in readings):
                    times.append(len({reading["time_s"] for reading in readings}))
                if len(times) == WHOLE:
                    return times, client.status()
    finally:
        simulation.stop()
    raise AssertionError(f"{len(threading.enumerate())} threads: the daemon went away")


@pytest.mark.long
@pytest.mark.parametrize(("line", "samplings_of_a_cycle"), [({}, 9), ({"round_trigger": TRIGGER}, 1)])
def test_a_cycle_has_one_latch_behind_a_trigger_and_nine_samplings_without(tmp_path, line, samplings_of_a_cycle):
    with run_directory() as directory:
        times, status = samplings(nine_units(tmp_path, **line), directory)
    assert set(times) == {samplings_of_a_cycle}
    assert 0.0 < status["skew_s"] < 5.0
    assert status["lines"]["joints"]["gauges"]["j1"]["faults"] == {}
