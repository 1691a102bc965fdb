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
from pathlib import Path

from compd.clock import Clock
from compd.gauge import good
from compd.live import daemon as daemon_module
from compd.live.memory import Latest
from tests.benchmarks.bench_loop import configuration
from tests.benchmarks.figures import median_and_p99, quiet, show
from tests.benchmarks.limits import first_good, printed_lines, run_limited
from tests.support.live_machine import RAW_AT_ZERO_MM
from tests.support.running_daemon import supervised

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


class AllAtOnce:
    """In the place of the lines: all gauges have a new reading at the same moment, again and again."""

    def __init__(self, lines: object, stale_after_s: object, latest: Latest, clock: Clock, **others: object) -> None:
        self.lines: dict[str, object] = {}
        self._latest = latest
        self._clock = clock
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def start(self) -> None:
        self._thread.start()

    def _run(self) -> None:
        while not self._clock.wait(self._stop, ROUND_S):
            now_s = self._clock.monotonic()
            for slot in range(len(self._latest.channels)):
                self._latest.put(slot, good(RAW_AT_ZERO_MM, now_s))

    def status(self) -> dict[str, object]:
        return {}

    def stop(self, timeout_s: float) -> bool:
        self._stop.set()
        self._thread.join()
        return True


def measure(rate_hz: float) -> list[tuple[float, ...]]:
    """Reading to tick, tick to client, reading to client (s), for READINGS rounds."""
    with tempfile.TemporaryDirectory(prefix="bench-") as directory, supervised(configuration(Path(directory), rate_hz)):
        first_good(f"{directory}/s")
        client = subprocess.Popen([sys.executable, "-c", CLIENT, f"{directory}/s"], stdout=subprocess.PIPE, text=True)
        found = [tuple(map(float, line.split())) for line in printed_lines(client, READINGS)]
        client.terminate()
        client.communicate()
    return found


def main() -> None:
    quiet()
    daemon_module.Acquisition = AllAtOnce  # type: ignore[misc, assignment]
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
    run_limited(main, RATES_HZ=(200,), READINGS=5)
