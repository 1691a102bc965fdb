"""How late the loop wakes and how soon a client has a setpoint, beside six busy drivers and beside cyclictest.

`python -m tests.benchmarks.bench_loop [--load] [--rounds 5]`; cyclictest is from rt-tests. The daemon is the whole one,
with all its processes; only its lines are replaced, by six threads that ask, parse and store as fast as they can. With
`--load` two processes that do nothing but count run beside.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from compd.configuration import Configuration, load
from compd.gauge import good
from compd.live import daemon as daemon_module
from compd.live.loop.timing import BIN_US
from compd.live.machine import MachineZero
from compd.live.memory import Latest
from compd.live.system import THIS_COMPUTER
from compd.operation_settings import SocketSettings, StateSettings
from tests.benchmarks.figures import quiet, show
from tests.benchmarks.limits import first_good, run_limited
from tests.support.live_machine import CONFIG, RAW_AT_ZERO_MM
from tests.support.running_daemon import supervised

SECONDS = 10
RATES_HZ = (200, 1000)
DRIVERS = 6
PRIORITY = 40
# A controller's own program has a priority too; without one the client would be measured, and not the daemon.
CLIENT_PRIORITY = 30
SHARES = (0.5, 0.99, 0.999)
# How much later than cyclictest the loop may wake, by share; and how late a client may have a setpoint, us.
WANTED_RATIOS = (2.0, 2.0, 4.0)
WANTED_AT_CLIENT_US = 600.0
# What a scale display sends: sign, ten characters, blank, unit, sort, series.
PATTERN = re.compile(rb"([+\- ])([ 0-9.]{10}) ([ \"?])([<>=? ])([SAGD ])\r\n")
REPLY = f"+{RAW_AT_ZERO_MM:10.4f}  = \r\n".encode()

# The other end of the lines, in a process of its own: it answers at once, so the threads never rest.
DEVICES = """
import select, socket, sys
reply = bytes.fromhex(sys.argv[1])
lines = [socket.socket(fileno=int(number)) for number in sys.argv[2:]]
while True:
    for line in select.select(lines, [], [])[0]:
        if not line.recv(16):
            sys.exit()
        line.sendall(reply)
"""

# Notes when each setpoint came, and prints at the end how long after its tick, us. To read JSON takes time of its own.
CLIENT = """
import json, os, socket, sys, time
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(int(sys.argv[2])))
except OSError:
    pass
line = socket.socket(socket.AF_UNIX)
line.connect(sys.argv[1])
line.sendall(b'{"class":"WATCH"}\\n')
pieces, lines = [], 0
while lines < int(sys.argv[3]):
    piece = line.recv(65536)
    pieces.append((time.monotonic(), piece))
    lines += piece.count(b"\\n")
rest = b""
for now_s, piece in pieces:
    *whole, rest = (rest + piece).split(b"\\n")
    for message in map(json.loads, whole):
        if message["class"] == "SETPOINT":
            print(f"{(now_s - message['time_s']) * 1e6:.0f}")
"""

BUSY = "while True: pass"


class BusyDrivers:
    """In the place of the lines: six threads that ask, read, parse and store as fast as the other end answers."""

    def __init__(self, lines: object, stale_after_s: object, latest: Latest, clock: object, **others: object) -> None:
        self.lines: dict[str, object] = {}
        self._latest = latest
        self._polls = [0] * DRIVERS

    def start(self) -> None:
        pairs = [socket.socketpair() for _ in range(DRIVERS)]
        far = [pair[1].fileno() for pair in pairs]
        self._devices = subprocess.Popen([sys.executable, "-c", DEVICES, REPLY.hex(), *map(str, far)], pass_fds=far)
        for number, (near, other) in enumerate(pairs):
            other.close()
            threading.Thread(target=self._drive, args=(number, near), daemon=True).start()

    def _drive(self, number: int, line: socket.socket) -> None:
        while True:
            time_s = time.monotonic()
            line.sendall(b"\x02")
            match = PATTERN.fullmatch(line.recv(64))
            assert match is not None
            value = float(match[1] + match[2].strip())
            for slot in range(number, len(self._latest.channels), DRIVERS):
                self._latest.put(slot, good(value, time_s))
            self._polls[number] += 1

    def status(self) -> dict[str, object]:
        return {"busy": {"state": "open", "polls": sum(self._polls)}}

    def stop(self, timeout_s: float) -> bool:
        self._devices.kill()
        return True


class Round(NamedTuple):
    """One run: lateness of the loop and of cyclictest and setpoints at the client, us, by share; cycles missed."""

    loop_us: list[float]
    cyclictest_us: list[float]
    client_us: list[float]
    missed: int


def configuration(directory: Path, rate_hz: float) -> Configuration:
    """The shipped tripod with this rate, and with machine zero taken."""
    loaded = load(CONFIG / "tripod-cmm.yaml")
    zero = MachineZero(
        loaded.zero_hash,
        "2026-01-01T00:00:00+00:00",
        {
            f"{name}.{channel.name}": RAW_AT_ZERO_MM
            for name, gauge in loaded.gauge_objects().items()
            for channel in gauge.channels
        },
        {quantity.name: RAW_AT_ZERO_MM for quantity in loaded.wiring.quantities},
    )
    (directory / "state").mkdir()
    zero.save(directory / "state", THIS_COMPUTER)
    return replace(
        loaded,
        loop=loaded.loop.model_copy(update={"rate_hz": rate_hz, "priority": PRIORITY, "stale_after_s": 1e6}),
        sockets=SocketSettings(tcp=None, unix={"path": str(directory / "s")}, valid_for_s=0.1),
        state=StateSettings(directory=str(directory / "state")),
    )


@contextmanager
def load_beside(processes: int) -> Iterator[None]:
    """So many processes that do nothing but count."""
    busy = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(processes)]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


def cyclictest(rate_hz: float) -> subprocess.Popen[str] | None:
    """Started, for as long as the loop is measured; None where it is not installed."""
    if shutil.which("cyclictest") is None:
        return None
    command = [
        "cyclictest",
        "--quiet",
        "--mlockall",
        f"--priority={PRIORITY}",
        f"--interval={round(1e6 / rate_hz)}",
        f"--loops={round(SECONDS * rate_hz)}",
        "--histogram=50000",
    ]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def quantiles_us(process: subprocess.Popen[str] | None) -> list[float]:
    """Of cyclictest's own histogram; nan where it did not run."""
    if process is None:
        return [float("nan")] * len(SHARES)
    output, _ = process.communicate()
    rows = [(int(us), int(count)) for us, count in re.findall(r"(?m)^(\d{6}) (\d+)$", output)]
    if not rows:
        print(f"cyclictest did not run: {output.strip().splitlines()[-1:]}")
        return [float("nan")] * len(SHARES)
    late_us, counts = np.array(rows).T
    return [float(late_us[np.searchsorted(counts.cumsum(), share * counts.sum())]) for share in SHARES]


def measure(rate_hz: float) -> Round:
    """The daemon with a client at full rate for SECONDS, and cyclictest beside it."""
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="bench-")))
        settings = configuration(directory, rate_hz)
        daemon = stack.enter_context(supervised(settings))
        first_good(directory / "s")
        timing = daemon.loop_process.timing
        counts, missed = timing.lateness.counts, timing.missed
        beside = cyclictest(rate_hz)
        arguments = [str(directory / "s"), str(CLIENT_PRIORITY), str(round(SECONDS * rate_hz))]
        watching = subprocess.run(
            [sys.executable, "-c", CLIENT, *arguments], stdout=subprocess.PIPE, text=True, check=True
        )
        reference_us = quantiles_us(beside)
        counts = timing.lateness.counts - counts
        late_us = [BIN_US * np.searchsorted(counts.cumsum(), share * counts.sum()) for share in SHARES]
        at_client_us = np.quantile(np.array(watching.stdout.split(), dtype=float), SHARES).tolist()
        return Round([float(us) for us in late_us], reference_us, at_client_us, timing.missed - missed)


def medians(rows: list[list[float]]) -> list[float]:
    """By share, over the rounds."""
    return [statistics.median(column) for column in zip(*rows, strict=True)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--load", action="store_true", help="two processes that only count run beside")
    parser.add_argument("--rounds", type=int, default=1)
    options = parser.parse_args()
    quiet()
    daemon_module.Acquisition = BusyDrivers  # type: ignore[misc, assignment]
    if shutil.which("cyclictest") is None:
        print("cyclictest is not installed (apt-get install rt-tests): the loop is measured alone")
    rounds: dict[float, list[Round]] = {rate_hz: [] for rate_hz in RATES_HZ}
    with load_beside(2 if options.load else 0):
        for number in range(options.rounds):
            for rate_hz in RATES_HZ:
                rounds[rate_hz].append(measure(rate_hz))
                print(f"round {number + 1} of {options.rounds}, {rate_hz} Hz: {rounds[rate_hz][-1]}", file=sys.stderr)
    rows = []
    for rate_hz, runs in rounds.items():
        loop_us = medians([run.loop_us for run in runs])
        reference_us = medians([run.cyclictest_us for run in runs])
        client_us = medians([run.client_us for run in runs])
        missed = statistics.median(run.missed for run in runs)
        ratios = [ours / other for ours, other in zip(loop_us, reference_us, strict=True)]
        for name, figures in (
            ("loop, us", loop_us),
            ("cyclictest, us", reference_us),
            ("tick to client, us", client_us),
        ):
            rows.append([f"{rate_hz} Hz: {name}", *(f"{figure:.0f}" for figure in figures), ""])
        rows[-3][-1] = f"{missed:.0f}"
        rows.append([f"{rate_hz} Hz: loop / cyclictest", *(f"{ratio:.1f}" for ratio in ratios), ""])
    rows.append(["wanted: loop / cyclictest", *(f"{ratio:g}" for ratio in WANTED_RATIOS), ""])
    rows.append(["wanted: tick to client, us", "", f"{WANTED_AT_CLIENT_US:.0f}", ""])
    beside = "six busy drivers and two busy processes" if options.load else "six busy drivers"
    show(
        f"Lateness beside {beside}, {SECONDS} s, medians of {options.rounds}; {os.cpu_count()} processors",
        ["", *(f"{100 * share:g} %" for share in SHARES), "missed"],
        rows,
    )


if __name__ == "__main__":
    run_limited(main, RATES_HZ=(200,), SECONDS=1)
