"""What one client's flood of requests costs another client's setpoints: `python -m tests.benchmarks.bench_flood`.

A client in a process of its own notes how long each setpoint took to arrive, while another sends requests as fast as
the daemon takes them. The ratio is to the same without a flood, side by side in one run.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from compd.live import daemon as daemon_module
from tests.benchmarks.bench_latency import AllAtOnce
from tests.benchmarks.bench_loop import configuration
from tests.benchmarks.figures import median_and_p99, quiet, show
from tests.benchmarks.limits import first_good, printed_lines, run_limited
from tests.support.running_daemon import supervised

RATE_HZ = 200
SETPOINTS = 1000

WATCHER = """
import sys, time
from compd.client import connect
with connect(sys.argv[1]) as client:
    for number, setpoint in enumerate(client.watch()):
        print(time.monotonic() - setpoint["time_s"], setpoint["valid_until"] - setpoint["time_s"], flush=True)
"""
FLOODER = """
import select, socket, sys
flood = socket.socket(socket.AF_UNIX)
flood.connect(sys.argv[1])
flood.setblocking(False)
request, reads = sys.argv[2].encode() + b"\\n", sys.argv[3] == "reads"
print(flush=True)
while True:
    readable, writable, _ = select.select([flood] if reads else [], [flood], [])
    if readable and not flood.recv(1 << 20):
        break
    if writable:
        try:
            flood.send(request * 100)
        except OSError:  # dropped: it took no answers
            break
"""
FLOODS = {
    "no flood": (),
    "STATUS": ('{"class":"STATUS"}', "reads"),
    "STATUS, answers not read": ('{"class":"STATUS"}', "deaf"),
    "VERSION": ('{"class":"VERSION"}', "reads"),
}


def measure(socket_path: str, *flood: str) -> list[float]:
    """Delay from the snapshot to the client (s) of SETPOINTS setpoints, under a flood."""
    flooder = None
    if flood:
        flooder = subprocess.Popen([sys.executable, "-c", FLOODER, socket_path, *flood], stdout=subprocess.PIPE)
        assert flooder.stdout is not None
        flooder.stdout.readline()
    watcher = subprocess.Popen([sys.executable, "-c", WATCHER, socket_path], stdout=subprocess.PIPE, text=True)
    delays_s = [float(line.split()[0]) for line in printed_lines(watcher, SETPOINTS)]
    for process in filter(None, (watcher, flooder)):
        process.kill()
        process.communicate()
    return delays_s


def main() -> None:
    quiet()
    daemon_module.Acquisition = AllAtOnce  # type: ignore[misc, assignment]
    rows = []
    with tempfile.TemporaryDirectory(prefix="bench-") as directory, supervised(configuration(Path(directory), RATE_HZ)):
        first_good(f"{directory}/s")
        alone_s = 0.0
        for name, flood in FLOODS.items():
            median_s, p99_s = median_and_p99(measure(f"{directory}/s", *flood))
            alone_s = alone_s or p99_s
            rows.append([name, f"{median_s * 1e3:.2f}", f"{p99_s * 1e3:.2f}", f"{p99_s / alone_s:.2f}"])
    show(
        f"Arrival of {SETPOINTS} setpoints at {RATE_HZ} Hz while another client floods the daemon",
        ["", "median ms", "p99 ms", "p99 / without"],
        rows,
    )


if __name__ == "__main__":
    run_limited(main, SETPOINTS=10, FLOODS=dict(list(FLOODS.items())[:2]))
