"""Throughput of a Modbus RTU line with nine comparators, beside what the line itself can carry.

    python -m tests.benchmarks.bench_throughput

A slave in a process of its own answers on a pty as slowly as the wire would: each character takes its time, and the
slave keeps its silence (or takes 10 ms) before it answers. The ideal is
`compd.commissioning.line_budget`'s, bits and silences alone.
"""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import time
import tty
from collections.abc import Sequence
from typing import Any

from compd.clock import MonotonicClock
from compd.commissioning.line_budget import budget_of_line, serial_pace
from compd.configuration.lines import ModbusRtuLine
from compd.gauge import Gauge
from compd.lines import open_line
from compd.lines.modbus_rtu import crc16
from compd.live.acquisition.acquisition import Acquisition
from compd.live.memory.latest import Latest
from compd.live.realtime import sharpen_timers
from compd.plugins import GAUGES, load

SECONDS = 4.0  # of measuring per row
FORMAT = "8N1"
WANTED = 0.90
SPIN_S = 2e-4  # before a deadline: sleeping is not that exact
FIFO_CHARACTERS = 16  # a UART hands over so many at a time


def slave(fd: int, baud: int, turnaround_s: float) -> None:
    """Answer every read request with counting registers, at the wire's pace, until killed."""
    character_s = serial_pace(baud, FORMAT, rtu=True).character_s
    print("listening", flush=True)
    while True:
        request = b""
        while len(request) < 8:
            request += os.read(fd, 8 - len(request))
        now_s = time.monotonic() + 8 * character_s + turnaround_s
        unit, function, _, count = struct.unpack(">BBHH", request[:6])
        reply = bytes([unit, function, 2 * count]) + b"".join((k + 1).to_bytes(2, "big") for k in range(count))
        reply += crc16(reply).to_bytes(2, "little")
        for at in range(0, len(reply), FIFO_CHARACTERS):
            piece = reply[at : at + FIFO_CHARACTERS]
            now_s += len(piece) * character_s
            _until(now_s)
            os.write(fd, piece)


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


def measure(kind: str, baud: int, turnaround_s: float | None, threaded: bool) -> tuple[float, float]:
    """Rounds per second, reached and ideal. `threaded`: through the daemon's own line thread."""
    polled = gauges(kind)
    line = ModbusRtuLine(kind="modbus_rtu", port="/dev/null", baud=baud, format=FORMAT, timeout_s=0.5)
    pace = serial_pace(baud, FORMAT, rtu=True, turnaround_s=turnaround_s)
    plan = budget_of_line("x", line, {name: gauge.traffic() for name, gauge in polled.items()})
    ideal_s = pace.round_s([exchange for gauge in polled.values() for exchange in gauge.traffic() or ()])
    assert plan.bytes == {"int16": 31, "float32": 49, "units": 135}[kind]
    master, far = os.openpty()
    tty.setraw(far)
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "tests.benchmarks.bench_throughput",
            "slave",
            str(master),
            str(baud),
            str(pace.turnaround_s),
        ],
        pass_fds=[master],
        stdout=subprocess.PIPE,
    )
    assert process.stdout is not None
    process.stdout.readline()  # it is listening
    settings = line.model_copy(update={"port": os.ttyname(far)})
    try:
        rate_hz = _through_thread(settings, polled) if threaded else _polled(settings, polled)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        os.close(master)
        os.close(far)
    return rate_hz, 1 / ideal_s


def _polled(settings: ModbusRtuLine, polled: dict[str, Gauge[Any]]) -> float:
    line = open_line(settings, MonotonicClock())
    try:
        for _ in range(3):
            _round(line, polled)
        rounds, start_s = 0, time.monotonic()
        while (now_s := time.monotonic()) < start_s + SECONDS:
            _round(line, polled)
            rounds += 1
        return rounds / (now_s - start_s)
    finally:
        line.close()


def _round(line: Any, polled: dict[str, Gauge[Any]]) -> None:
    for gauge in polled.values():
        if not all(reading.ok for reading in gauge.read(line)):
            raise SystemExit("a reading was not ok: the computer is too busy to measure")


def _through_thread(settings: ModbusRtuLine, polled: dict[str, Gauge[Any]]) -> float:
    latest = Latest([f"{name}.{channel.name}" for name, gauge in polled.items() for channel in gauge.channels])
    acquisition = Acquisition(
        {"x": (settings, list(polled.items()))}, dict.fromkeys(polled, 1.0), latest, MonotonicClock()
    )
    acquisition.start()
    time.sleep(0.5)
    gauge = acquisition.lines["x"].gauges[-1]
    before, start_s = gauge.ok, time.monotonic()
    time.sleep(SECONDS)
    rate_hz = (gauge.ok - before) / (time.monotonic() - start_s)
    acquisition.stop()
    return rate_hz


def main() -> None:
    sharpen_timers()  # as the daemon's line threads do
    rows = [
        (kind, baud, turnaround_s, False)
        for kind in ("int16", "float32", "units")
        for baud in (19200, 115200)
        for turnaround_s in (None, 10e-3)
    ]
    rows += [(kind, 115200, None, True) for kind in ("int16", "float32", "units")]
    print(
        f"{'nine values as':16}{'baud':>8}{'turnaround':>12}{'asked by':>14}{'ideal Hz':>10}{'reached':>9}{'ratio':>7}"
    )
    for kind, baud, turnaround_s, threaded in rows:
        reached_hz, ideal_hz = measure(kind, baud, turnaround_s, threaded)
        ratio = reached_hz / ideal_hz
        print(
            f"{kind:16}{baud:8}{'silence' if turnaround_s is None else '10 ms':>12}"
            f"{'line thread' if threaded else 'driver':>14}{ideal_hz:10.1f}{reached_hz:9.1f}{ratio:7.2f}"
            f"{'' if ratio >= WANTED else f'  below {WANTED}'}",
            flush=True,
        )


if __name__ == "__main__":
    if len(sys.argv) == 5 and sys.argv[1] == "slave":
        slave(int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))
    else:
        main()
