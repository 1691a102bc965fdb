"""How late the loop wakes, with six busy driver threads, beside cyclictest in the same run.

`python -m tests.benchmarks.bench_loop`; cyclictest is from rt-tests.
"""

from __future__ import annotations

import re
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace

from compd.clock import MonotonicClock
from compd.configuration.operation import LoopSettings
from compd.gauge import good
from compd.live.loop.loop import Loop
from compd.live.loop.timing import Histogram
from compd.live.memory.latest import Latest
from compd.live.systemd import Notifier
from tests.benchmarks.figures import quiet, show
from tests.support.live_machine import RAW_AT_ZERO_MM, machine

SECONDS = 10
RATES_HZ = (200, 1000)
DRIVERS = 6
PRIORITY = 40
HISTOGRAM_US = 20_000
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


@contextmanager
def busy_drivers(latest: Latest) -> Iterator[list[int]]:
    """Six threads that ask, read, parse and store as fast as the other end answers; how often each has."""
    stop = threading.Event()
    polls = [0] * DRIVERS

    def drive(number: int, line: socket.socket) -> None:
        while not stop.is_set():
            time_s = time.monotonic()
            line.sendall(b"\x02")
            match = PATTERN.fullmatch(line.recv(64))
            assert match is not None
            value = float(match[1] + match[2].strip())
            for slot in range(number, len(latest.channels), DRIVERS):
                latest.put(slot, good(value, time_s))
            polls[number] += 1

    with ExitStack() as stack:
        pairs = [socket.socketpair() for _ in range(DRIVERS)]
        for pair in pairs:
            stack.callback(pair[0].close)
            stack.callback(pair[1].close)
        far = [pair[1].fileno() for pair in pairs]
        device = subprocess.Popen([sys.executable, "-c", DEVICES, REPLY.hex(), *map(str, far)], pass_fds=far)
        stack.callback(device.wait)
        stack.callback(device.terminate)
        threads = [threading.Thread(target=drive, args=(i, pair[0]), daemon=True) for i, pair in enumerate(pairs)]
        for thread in threads:
            thread.start()
        try:
            yield polls
        finally:
            stop.set()
            for thread in threads:
                thread.join()


def cyclictest(rate_hz: float) -> subprocess.Popen[str] | None:
    """Started, for as long as the loop runs; None where it is not installed."""
    if shutil.which("cyclictest") is None:
        return None
    command = [
        "cyclictest",
        "--quiet",
        "--mlockall",
        f"--priority={PRIORITY}",
        f"--interval={round(1e6 / rate_hz)}",
        f"--loops={round(SECONDS * rate_hz)}",
        f"--histogram={HISTOGRAM_US}",
    ]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def histogram_of(process: subprocess.Popen[str]) -> Histogram | None:
    """cyclictest's own histogram as ours; None, with what it said, when it could not run."""
    output, _ = process.communicate()
    histogram = Histogram()
    for us, count in re.findall(r"(?m)^(\d{6}) (\d+)$", output):
        for _ in range(int(count)):
            histogram.add(int(us) * 1e-6)
    if not histogram.count:
        print(f"cyclictest did not run: {output.strip().splitlines()[-1:]}")
        return None
    return histogram


def run_loop(rate_hz: float) -> tuple[Loop, Histogram | None]:
    """The daemon's loop with its whole cycle for SECONDS, cyclictest beside it."""
    measured = machine()
    settings = LoopSettings(rate_hz=rate_hz, stale_after_s=1, on_stale="hold", hold_s=1, priority=PRIORITY)
    done = threading.Event()
    ticks = round(SECONDS * rate_hz)
    encoded_bytes = 0

    def sink(setpoint) -> None:
        nonlocal encoded_bytes
        encoded_bytes += len(setpoint.to_json())
        if setpoint.seq >= ticks:
            done.set()

    with busy_drivers(measured.latest) as polls:
        cycle = replace(measured.settings, loop=settings)
        loop = Loop(cycle, measured.latest, measured.commands, [sink], Notifier(""), MonotonicClock())
        beside = cyclictest(rate_hz)
        loop.start()
        done.wait()
        loop.stop()
        reference = histogram_of(beside) if beside is not None else None
    print(
        f"{rate_hz:g} Hz: six drivers made {sum(polls)} polls; "
        + "; ".join(
            f"{name}: {'granted' if p.granted else 'NOT granted'} ({p.detail})" for name, p in loop.permissions.items()
        )
    )
    return loop, reference


def main() -> None:
    quiet()
    if shutil.which("cyclictest") is None:
        print("cyclictest is not installed (apt-get install rt-tests): the loop is measured alone")
    rows = []
    for rate_hz in RATES_HZ:
        loop, reference = run_loop(rate_hz)
        ours = loop.timing.lateness
        others = {"compd loop": ours} if reference is None else {"compd loop": ours, "cyclictest": reference}
        for name, histogram in others.items():
            median, p99 = histogram.quantile_us(0.5), histogram.quantile_us(0.99)
            ratio = f"{ours.quantile_us(0.5) / median:.1f}" if histogram is reference else ""
            ratio99 = f"{ours.quantile_us(0.99) / p99:.1f}" if histogram is reference else ""
            missed = str(loop.timing.missed) if histogram is ours else ""
            rows.append(
                [
                    f"{rate_hz:g} Hz: {name}",
                    f"{median:.0f}",
                    f"{p99:.0f}",
                    f"{histogram.largest_us:.0f}",
                    ratio,
                    ratio99,
                    missed,
                ]
            )
    header = [
        "lateness of waking",
        "median us",
        "p99 us",
        "largest us",
        "loop / it, median",
        "loop / it, p99",
        "missed",
    ]
    show(f"Wake-up lateness over {SECONDS} s beside six busy driver threads", header, rows)


if __name__ == "__main__":
    main()
