"""What a dead unit behind a Modbus TCP gateway costs the others: `python -m tests.benchmarks.bench_gateway [SECONDS]`.

Six units on one bus, and 10 ms for an exchange; one unit dies at 0 s, and the gateway waits 1 s for it each time. The
figures are shares of snapshots, taken a hundred times a second, in which every other unit's reading was good and less
than 0.5 s old: in the first 20 s, and from then to the end. All rows are measured at the same time. Six lines to one
gateway name it by six addresses: `compd check` refuses lines with one.
"""

from __future__ import annotations

import argparse
import threading
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from compd.gauge import Gauge
from compd.lines.kinds.modbus_tcp.settings import ModbusTcpLine
from compd.live.acquisition import Acquisition
from compd.live.memory import Latest
from compd.live.system import THIS_COMPUTER
from compd.plugins import GAUGES, load
from tests.benchmarks.figures import quiet, show
from tests.benchmarks.limits import run_limited
from tests.support.serial_gateway import SerialGateway, serial_gateway

SECONDS = 140.0
BEGINNING_S = 20.0
UNITS, DEAD = 6, 3
EXCHANGE_S, WAIT_S = 10e-3, 1.0
STALE_AFTER_S = 0.5
SNAPSHOT_S = 10e-3
SETTLED_S = 1.0  # before the unit dies
WANTED = 0.99


@dataclass(frozen=True)
class Case:
    """lines : 1, or one for each unit. wait_s : the gateway's. keys : of the lines."""

    name: str
    keys: dict[str, float]
    exceptions: bool
    lines: int = 1
    wait_s: float = WAIT_S


CASES = (
    Case("exception 11 at once, timeout 0.3 s", {"timeout_s": 0.3}, True, wait_s=0.0),
    Case("exception 11, timeout 0.3 s", {"timeout_s": 0.3}, True),
    Case("exception 11, timeout 1.5 s", {"timeout_s": 1.5}, True),
    Case("silence, timeout 0.3 s", {"timeout_s": 0.3}, False),
    Case("silence, timeout 1.5 s", {"timeout_s": 1.5}, False),
    Case("silence, 0.3 s, gateway_wait_s 1", {"timeout_s": 0.3, "gateway_wait_s": 1.0}, False),
    Case("silence, timeout 0.3 s, six lines", {"timeout_s": 0.3}, False, lines=UNITS),
)


def comparator(unit: int) -> Gauge[Any]:
    driver = load(GAUGES, "modbus", "benchmark")
    channel = {"name": "a", "function": 4, "address": 0, "type": "int16", "unit": "mm", "scale": 0.001}
    options = {"driver": "modbus", "line": "x", "unit": unit, "channels": [channel]}
    gauge: Gauge[Any] = driver(driver.Options.model_validate(options))
    return gauge


class Run:
    """A case under way, and its counts of snapshots."""

    def __init__(self, case: Case, gateway: SerialGateway) -> None:
        self.gateway = gateway
        gauges = {f"u{unit}": comparator(unit) for unit in range(1, UNITS + 1)}
        self._latest = Latest([f"{name}.a" for name in gauges])
        keys: dict[str, Any] = {"kind": "modbus_tcp", "port": gateway.port, **case.keys}
        # every address 127.x.x.x is this computer
        lines = [ModbusTcpLine.model_validate({**keys, "host": f"127.0.0.{1 + k}"}) for k in range(case.lines)]
        share = UNITS // case.lines
        polled = list(gauges.items())
        on_lines = {f"l{k}": (line, polled[k * share : (k + 1) * share]) for k, line in enumerate(lines)}
        self.acquisition = Acquisition(on_lines, dict.fromkeys(gauges, STALE_AFTER_S), self._latest, THIS_COMPUTER)
        self.counts = {"first": [0, 0], "then": [0, 0]}  # good, and all

    def look(self, now_s: float, died_s: float) -> None:
        """Count the snapshot of now."""
        readings = self._latest.snapshot(now_s).readings
        live = [reading for unit, reading in enumerate(readings, 1) if unit != DEAD]
        good = all(reading.ok and now_s - reading.time_s < STALE_AFTER_S for reading in live)
        count = self.counts["first" if now_s - died_s < BEGINNING_S else "then"]
        count[0] += good
        count[1] += 1

    def row(self, case: Case) -> tuple[str, ...]:
        shares = [good / total if total else float("nan") for good, total in self.counts.values()]
        note = "" if shares[1] >= WANTED else "refused" if case.lines > 1 else f"below {WANTED:g}"
        asked = str(self.gateway.asked[DEAD] - self._asked_before)
        return (case.name, *(f"{share:.3f}" for share in shares), asked, str(self.gateway.connections), note)

    def die(self) -> None:
        """Of the unit."""
        self._asked_before = self.gateway.asked[DEAD]
        self.gateway.dead.add(DEAD)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", nargs="?", type=float, default=SECONDS)
    seconds = parser.parse_args().seconds
    quiet()
    clock, never = THIS_COMPUTER, threading.Event()
    with ExitStack() as stack:
        runs = []
        for case in CASES:
            host = "127.0.0.1" if case.lines == 1 else "0.0.0.0"
            gateway = stack.enter_context(serial_gateway(UNITS, EXCHANGE_S, case.wait_s, case.exceptions, host))
            runs.append(Run(case, gateway))
            runs[-1].acquisition.start()
            stack.callback(runs[-1].acquisition.stop)
        clock.wait(never, SETTLED_S)
        for run in runs:
            run.die()
        died_s = clock.monotonic()
        while (now_s := clock.monotonic()) < died_s + seconds:
            for run in runs:
                run.look(now_s, died_s)
            clock.wait(never, SNAPSHOT_S)
        rows = [run.row(case) for case, run in zip(CASES, runs, strict=True)]
    header = ("gateway and lines", "first 20 s", f"to {seconds:g} s", "times asked", "connections", "")
    show("Snapshots in which the five live units were good and fresh", header, rows)


if __name__ == "__main__":
    run_limited(main, SECONDS=0.5, BEGINNING_S=0.25, SETTLED_S=0.2, CASES=CASES[:1])
