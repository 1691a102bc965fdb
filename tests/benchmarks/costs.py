"""What the README says that compd costs, measured in one run: `python -m tests.benchmarks.costs [--quick]`.

It takes half an hour, with fewer rounds and rows less, and the table says how many; `--quick` measures little of
everything and writes nothing.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from datetime import UTC, datetime
from pathlib import Path

from compd.fleet import examination
from compd.live import daemon as daemon_module
from tests.benchmarks import bench_fleet, bench_kilohertz, bench_long
from tests.benchmarks.bench_cycle import EFFECTS, whole_cycles
from tests.benchmarks.bench_latency import AllAtOnce
from tests.benchmarks.cost_table import Cost, save
from tests.benchmarks.figures import median_and_p99, quiet, show
from tests.benchmarks.limits import run_limited

MACHINES = ("tripod-cmm.yaml", "hexapod.yaml")
MODES = ("cmm", "machine_tool")


def cycle_costs() -> list[Cost]:
    """The dearest of both machines in both modes."""
    bare_s, whole_s, p99_s = max(
        (median_and_p99(whole_cycles(name, mode, 0))[0], *median_and_p99(whole_cycles(name, mode, len(EFFECTS))))
        for name in MACHINES
        for mode in MODES
    )
    return [
        Cost(
            f"a cycle with {len(EFFECTS)} effects, from the gauges' snapshot to the bytes for clients",
            f"{whole_s * 1e6:.0f} us, 99 %: {p99_s * 1e6:.0f} us",
            f"without effects: {bare_s * 1e6:.0f} us",
            f"{whole_s / bare_s:.2f}",
        )
    ]


def kilohertz_costs(seconds: int, rounds: int) -> list[Cost]:
    runs = bench_kilohertz.measure(seconds, rounds, lambda text: print(text, file=sys.stderr))
    missed, late = sum(run.missed for run, _ in runs), sum(late for _, late in runs)
    oldest_s = max(run.p99_s for run, _ in runs)
    cycles = f"{seconds * rounds * bench_kilohertz.RATE_HZ:,}"
    return [
        Cost(
            f"cycles missed at 1 kHz with {len(EFFECTS)} effects, of {cycles}",
            f"{missed}",
            f"wake-ups of `cyclictest` a period late: {late}",
            f"{missed / late:.2f}" if late else "-",
        ),
        Cost(
            "from a gauge's reading to a client at 1 kHz, 99 %",
            f"{oldest_s * 1e3:.2f} ms",
            "a period: 1 ms",
            f"{oldest_s * 1e3:.2f}",
        ),
    ]


def long_recording_costs(rows: int) -> list[Cost]:
    with tempfile.TemporaryDirectory() as temporary:
        parquet = bench_long.measure(rows, Path(temporary))[0]
    return [
        Cost(
            f"a comparison of {rows:,} rows with {len(bench_long.EFFECTS)} effects, by a sample, processor time",
            f"{parquet.compared.processor_s:.1f} s",
            f"pyarrow reads the file: {parquet.by_arrow.processor_s:.1f} s",
            f"{parquet.processor_ratio:.1f}",
        ),
        Cost("memory for that", f"{parquet.largest_MB:.0f} MB", "-", "-"),
    ]


def fleet_costs(count: int) -> list[Cost]:
    with tempfile.TemporaryDirectory() as temporary:
        paths = bench_fleet.recordings(Path(temporary), count)
        work = examination("compare")
        alone_s, both_s = (bench_fleet.measure(work, paths, workers).work_s for workers in (1, 2))
    return [
        Cost(
            f"`compd fleet compare` of {count} recordings, two workers",
            f"{both_s:.1f} s",
            f"one worker: {alone_s:.1f} s",
            f"{both_s / alone_s:.2f}",
        )
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="measure little of everything, write nothing")
    parser.add_argument("--rounds", type=int, default=5, help="runs of a minute at 1 kHz")
    parser.add_argument("--rows", type=int, default=2_000_000, help="of the long recording")
    parser.add_argument("--recordings", type=int, default=500, help="of the fleet")
    options = parser.parse_args()
    quiet()
    daemon_module.Acquisition = AllAtOnce  # type: ignore[misc, assignment]
    seconds, rounds = (5, 1) if options.quick else (60, options.rounds)
    rows, recordings = (300_000, 20) if options.quick else (options.rows, options.recordings)
    costs = [
        *cycle_costs(),
        *kilohertz_costs(seconds, rounds),
        *long_recording_costs(rows),
        *fleet_costs(recordings),
    ]
    show("What it costs", ["", "figure", "beside it", "ratio"], costs)
    if not options.quick:
        save(costs, f"{datetime.now(UTC):%Y-%m-%d}", os.cpu_count() or 0)


if __name__ == "__main__":
    run_limited(main)
