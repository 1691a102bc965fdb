"""Throughput of a Modbus RTU line with nine comparators, beside what the line itself can carry.

    python -m tests.benchmarks.bench_throughput

A slave in a process of its own answers on a pty as slowly as the wire would: each character takes its time, and the
slave keeps its silence (or takes 10 ms) before it answers. The ideal is
`compd.commissioning.line_budget`'s, bits and silences alone. The last rows are behind an FTDI adapter whose latency
timer nobody has shortened, as with `low_latency: false`. The processor's time is this process's alone, of which each
poll takes its part.
"""

from __future__ import annotations

import math
import os
import struct
import subprocess
import sys
import time
import tty
from collections.abc import Sequence
from typing import Any, NamedTuple

from compd.commissioning.line_budget import budget_of_line
from compd.gauge import Gauge
from compd.line_settings import LATENCY_TIMER_S, serial_pace
from compd.lines import open_line
from compd.lines.kinds.modbus_rtu.master import crc16
from compd.lines.kinds.modbus_rtu.settings import ModbusRtuLine
from compd.live.acquisition import Acquisition
from compd.live.memory import Latest
from compd.live.system import THIS_COMPUTER, sharpen_timers
from compd.plugins import GAUGES, load
from tests.benchmarks.limits import run_limited

KINDS = ("int16", "float32", "units")
SECONDS = 4.0  # of measuring per row
FORMAT = "8N1"
WANTED = 0.90
SPIN_S = 2e-4  # before a deadline: sleeping is not that exact
PLAIN = 0x3C00  # of a register: a number of usual size as int16 and, two of them, as float32
TRIES = 5  # of a row in which the computer pauses
FIFO_CHARACTERS = 16  # a UART hands over so many at a time


class Row(NamedTuple):
    """What is measured. threaded : by the daemon's line thread. timer_s : latency timer of the adapter, 0 for none."""

    kind: str
    baud: int
    turnaround_s: float | None
    threaded: bool = False
    timer_s: float = 0.0


class Disturbed(Exception):
    """A reading was not ok: the computer paused while it was measured."""


class Measured(NamedTuple):
    """rounds_hz, ideal_hz : rounds per second. cpu_us : processor time of this process per poll."""

    rounds_hz: float
    ideal_hz: float
    cpu_us: float


def slave(fd: int, baud: int, turnaround_s: float, timer_s: float) -> None:
    """Answer every read request with counting registers, at the wire's pace, until killed."""
    character_s = serial_pace(baud, FORMAT, rtu=True).character_s
    print("listening", flush=True)
    while True:
        request = b""
        while len(request) < 8:
            request += os.read(fd, 8 - len(request))
        now_s = time.monotonic() + 8 * character_s + turnaround_s
        unit, function, _, count = struct.unpack(">BBHH", request[:6])
        reply = bytes([unit, function, 2 * count]) + b"".join((PLAIN + k).to_bytes(2, "big") for k in range(count))
        reply += crc16(reply).to_bytes(2, "little")
        for at in range(0, len(reply), FIFO_CHARACTERS):
            piece = reply[at : at + FIFO_CHARACTERS]
            now_s += len(piece) * character_s
            if not timer_s:
                _until(now_s)
                os.write(fd, piece)
        if timer_s:
            # fewer than the 62 bytes of a full packet: they wait for the timer, which runs freely
            _until(timer_s * math.ceil(now_s / timer_s))
            os.write(fd, reply)


def _until(due_s: float) -> None:
    wait_s = due_s - time.monotonic() - SPIN_S
    if wait_s > 0:
        time.sleep(wait_s)
    while time.monotonic() < due_s:
        pass


def gauges(kind: str) -> dict[str, Gauge[Any]]:
    """Nine comparators: in one block of int16 or float32, or one register in each of nine units."""
    driver = load(GAUGES, "modbus", "benchmark")
    words = 2 if kind == "float32" else 1
    number = "int16" if kind == "units" else kind
    channels = [
        {"name": f"c{k}", "function": 4, "address": 0 if kind == "units" else k * words, "type": number, "unit": "mm"}
        for k in range(9)
    ]

    def make(unit: int, own: Sequence[dict[str, Any]]) -> Gauge[Any]:
        options = driver.Options.model_validate({"driver": "modbus", "line": "x", "unit": unit, "channels": own})
        gauge: Gauge[Any] = driver(options)
        return gauge

    if kind == "units":
        return {f"unit{k + 1}": make(k + 1, [channels[k]]) for k in range(9)}
    return {"block": make(1, channels)}


def measure(row: Row) -> Measured:
    polled = gauges(row.kind)
    line = ModbusRtuLine(kind="modbus_rtu", port="/dev/null", baud=row.baud, format=FORMAT, timeout_s=0.5)
    pace = serial_pace(row.baud, FORMAT, rtu=True, turnaround_s=row.turnaround_s)
    plan = budget_of_line("x", line, {name: gauge.traffic() for name, gauge in polled.items()})
    ideal_s = pace.round_s([exchange for gauge in polled.values() for exchange in gauge.traffic() or ()])
    assert plan.bytes == {"int16": 31, "float32": 49, "units": 135}[row.kind]
    master, far = os.openpty()
    tty.setraw(far)
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "tests.benchmarks.bench_throughput",
            "slave",
            str(master),
            str(row.baud),
            str(pace.turnaround_s),
            str(row.timer_s),
        ],
        pass_fds=[master],
        stdout=subprocess.PIPE,
    )
    assert process.stdout is not None
    process.stdout.readline()  # it is listening
    settings = line.model_copy(update={"port": os.ttyname(far)})
    try:
        rounds_hz, cpu_s = _through_thread(settings, polled) if row.threaded else _polled(settings, polled)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        os.close(master)
        os.close(far)
    return Measured(rounds_hz, 1 / ideal_s, cpu_s / len(polled) * 1e6)


def _undisturbed(row: Row) -> Measured:
    for _ in range(TRIES):
        try:
            return measure(row)
        except Disturbed:
            continue
    raise SystemExit(f"readings were not ok in {TRIES} tries: the computer is too busy to measure")


def _polled(settings: ModbusRtuLine, polled: dict[str, Gauge[Any]]) -> tuple[float, float]:
    """Rounds per second, and processor time per round, s."""
    line = open_line(settings, THIS_COMPUTER)
    try:
        for _ in range(3):
            _round(line, polled)
        rounds, start_s, cpu_s = 0, time.monotonic(), time.process_time()
        while (now_s := time.monotonic()) < start_s + SECONDS:
            _round(line, polled)
            rounds += 1
        return rounds / (now_s - start_s), (time.process_time() - cpu_s) / rounds
    finally:
        line.close()


def _round(line: Any, polled: dict[str, Gauge[Any]]) -> None:
    for gauge in polled.values():
        if not all(reading.ok for reading in gauge.read(line)):
            raise Disturbed


def _through_thread(settings: ModbusRtuLine, polled: dict[str, Gauge[Any]]) -> tuple[float, float]:
    """As `_polled`."""
    latest = Latest([f"{name}.{channel.name}" for name, gauge in polled.items() for channel in gauge.channels])
    acquisition = Acquisition(
        {"x": (settings, list(polled.items()))}, dict.fromkeys(polled, 1.0), latest, THIS_COMPUTER
    )
    acquisition.start()
    time.sleep(0.5)
    gauge = acquisition.lines["x"].gauges[-1]
    before, start_s, cpu_s = gauge.ok, time.monotonic(), time.process_time()
    time.sleep(SECONDS)
    rounds, duration_s, cpu_s = gauge.ok - before, time.monotonic() - start_s, time.process_time() - cpu_s
    acquisition.stop()
    return rounds / duration_s, cpu_s / rounds


def main() -> None:
    sharpen_timers()  # as the daemon's line threads do
    rows = [
        Row(kind, baud, turnaround_s) for kind in KINDS for baud in (19200, 115200) for turnaround_s in (None, 10e-3)
    ]
    rows += [Row(kind, 115200, None, threaded=True) for kind in KINDS]
    rows += [Row(kind, 115200, None, timer_s=LATENCY_TIMER_S) for kind in KINDS]
    print(
        f"{'nine values as':16}{'baud':>8}{'turnaround':>12}{'asked by':>14}{'ideal Hz':>10}{'reached':>9}{'ratio':>7}"
        f"{'CPU us/poll':>13}"
    )
    for row in rows:
        result = _undisturbed(row)
        ratio = result.rounds_hz / result.ideal_hz
        note = "  held back by the adapter" if row.timer_s else "" if ratio >= WANTED else f"  below {WANTED}"
        print(
            f"{row.kind:16}{row.baud:8}{'silence' if row.turnaround_s is None else '10 ms':>12}"
            f"{'line thread' if row.threaded else 'driver':>14}{result.ideal_hz:10.1f}{result.rounds_hz:9.1f}"
            f"{ratio:7.2f}{result.cpu_us:13.0f}{note}",
            flush=True,
        )


if __name__ == "__main__":
    if len(sys.argv) == 6 and sys.argv[1] == "slave":
        slave(int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]), float(sys.argv[5]))
    else:
        run_limited(main, SECONDS=0.2, KINDS=("int16",))
