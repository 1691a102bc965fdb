"""From a gauge's reading to the socket: `python -m tests.benchmarks.bench_latency`.

Every gauge is read anew at moments that have nothing to do with the loop's; a client in another process notes when the
first setpoint with these readings arrives. The wait for the next tick is half a period on average and no program can
shorten it; the rest is the daemon's.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import threading
from dataclasses import replace
from pathlib import Path

from compd.clock import MonotonicClock
from compd.configuration.operation import LoopSettings, SocketSettings
from compd.gauge import good
from compd.live.loop.loop import Loop
from compd.live.service.publisher import Publisher
from compd.live.service.requests import Requests, TargetKeys
from compd.live.systemd import Notifier
from tests.benchmarks.figures import median_and_p99, quiet, show
from tests.support.live_machine import RAW_AT_ZERO_MM, machine

RATES_HZ = (200, 1000)
READINGS = 500
# Between two rounds of readings; no multiple of a period, so that they drift through all its phases.
ROUND_S = 0.01137

CLIENT = """
import sys, time
from compd.client import connect
with connect(sys.argv[1]) as client:
    last = 0.0
    for setpoint in client.watch():
        now_s = time.monotonic()
        if setpoint["valid"]:
            read_s = setpoint["time_s"] - setpoint["age_s"]
            if read_s > last + 1e-4:  # both are rounded to the microsecond
                last = read_s
                print(setpoint["time_s"] - read_s, now_s - setpoint["time_s"], now_s - read_s, flush=True)
"""


def measure(rate_hz: float) -> list[tuple[float, ...]]:
    """Reading to tick, tick to client, reading to client (s), for READINGS rounds."""
    measured = machine()
    settings = LoopSettings(rate_hz=rate_hz, stale_after_s=1, on_stale="hold", hold_s=1)
    clock = MonotonicClock()
    stop = threading.Event()

    def read_gauges() -> None:
        while not clock.wait(stop, ROUND_S):
            now_s = clock.monotonic()
            for slot in range(len(measured.latest.channels)):
                measured.latest.put(slot, good(RAW_AT_ZERO_MM, now_s))

    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "s"
        publisher = Publisher(SocketSettings(unix={"path": str(path)}, valid_for_s=0.1), 1 / rate_hz, lambda _: None)
        version = {"class": "VERSION"}
        keys = TargetKeys("tip_B0_mm", rotation=False)
        publisher.start(Requests(version, keys, measured.commands, dict, lambda _: None))
        cycle = replace(measured.settings, loop=settings)
        loop = Loop(cycle, measured.latest, measured.commands, [publisher.deliver], Notifier(""), clock)
        loop.start()
        reader = threading.Thread(target=read_gauges)
        reader.start()
        client = subprocess.Popen([sys.executable, "-c", CLIENT, str(path)], stdout=subprocess.PIPE, text=True)
        assert client.stdout is not None
        found = [tuple(map(float, client.stdout.readline().split())) for _ in range(READINGS)]
        client.terminate()
        client.communicate()
        stop.set()
        reader.join()
        loop.stop()
        publisher.stop()
    return found


def main() -> None:
    quiet()
    rows = []
    for rate_hz in RATES_HZ:
        parts = zip(*measure(rate_hz), strict=True)
        for name, durations in zip(("reading to tick", "tick to client", "reading to client"), parts, strict=True):
            median, p99 = median_and_p99(durations)
            rows.append(
                [
                    f"{rate_hz:g} Hz: {name}",
                    f"{median * 1e6:.0f}",
                    f"{p99 * 1e6:.0f}",
                    f"{median * rate_hz:.2f}",
                    f"{p99 * rate_hz:.2f}",
                ]
            )
    show(
        f"Gauge to socket, {READINGS} readings, client in another process",
        ["", "median us", "p99 us", "median / period", "p99 / period"],
        rows,
    )


if __name__ == "__main__":
    main()
