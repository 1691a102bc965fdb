"""How a fleet's work is shared out: `python -m tests.benchmarks.bench_fleet --recordings 500`.

Simulated recordings of about 600 rows, compared by one worker process and by as many as there are cores. The start of
the workers is apart: it is the same however many recordings there are. Processor times tell what sharing out costs
from what a busy machine, or two cores that are one, take: of the workers for the work, and of the scheduler beside it.
"""

from __future__ import annotations

import argparse
import os
import shutil
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from compd.fleet import Examination, examination, find_recordings
from compd.fleet.cluster import open_cluster
from compd.fleet.engine import outcomes
from compd.fleet.examine import BATCH
from compd.fleet.fleet_recording import FleetRecording
from compd.simulation import simulate_campaign
from tests.benchmarks.figures import show
from tests.benchmarks.limits import run_limited

# Recordings that are simulated; the others are copies.
RECORDINGS = 60
DIFFERENT = 5
BUDGET = 0.85
# By wall time, which other programs stretch; by processor time, on cores that nobody else uses.
HEAD = ("efficiency", "eff. / budget", "by processor time")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.bench_fleet", description=__doc__)
    parser.add_argument("--recordings", type=int, default=RECORDINGS)
    parser.add_argument("--command", choices=["compare", "diagnose"], default="compare")
    options = parser.parse_args()
    cores = len(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as temporary:
        paths = recordings(Path(temporary), options.recordings)
        work = examination(options.command)
        rows = []
        alone = Cost(0.0, 0.0, 0.0, 0.0)
        for workers in dict.fromkeys((1, cores)):
            cost = measure(work, paths, workers)
            alone = cost if workers == 1 else alone
            by_wall = alone.work_s / (workers * cost.work_s)
            by_processor = alone.workers_processor_s / (cost.workers_processor_s + cost.scheduler_processor_s)
            numbers = [*cost, by_wall, by_wall / BUDGET, by_processor]
            rows.append([str(workers), *(f"{number:.2f}" for number in numbers)])
    head = ["workers", "start, s", "work, s", "workers' processor, s", "scheduler's", *HEAD]
    title = f"{len(paths)} recordings, {options.command}; efficiency = T1 / (workers * T), budget {BUDGET}"
    show(title, head, rows)


def recordings(directory: Path, count: int) -> tuple[FleetRecording, ...]:
    """So many recordings of about 600 rows, written there."""
    for number in range(count):
        path = directory / f"{number:04d}.csv"
        if number < DIFFERENT:
            simulate_campaign("tripod-cmm", path, seed=number + 1, effects=["link_expansion"])
        else:
            for ending in (".csv", ".yaml"):
                shutil.copy(directory / f"{number % DIFFERENT:04d}{ending}", path.with_suffix(ending))
    return find_recordings([directory]).recordings


class Cost(NamedTuple):
    """Seconds until every worker has done one recording, and of all recordings after that; processor time of these."""

    start_s: float
    work_s: float
    workers_processor_s: float
    scheduler_processor_s: float


def measure(work: Examination, paths: Sequence[FleetRecording], workers: int) -> Cost:
    """What this work on all recordings takes with so many worker processes."""
    begun_s = time.perf_counter()
    with open_cluster(processes=workers) as client:
        client.run(work, paths[0])
        started_s, own_s = time.perf_counter(), time.process_time()
        workers_s = sum(client.run(time.process_time).values())
        failed = [outcome.error for outcome in outcomes(client, work, paths, BATCH[work.command]) if outcome.error]
        done_s, own_s = time.perf_counter(), time.process_time() - own_s
        workers_s = sum(client.run(time.process_time).values()) - workers_s
    assert not failed, failed
    return Cost(started_s - begun_s, done_s - started_s, workers_s, own_s)


if __name__ == "__main__":
    run_limited(main, RECORDINGS=2, DIFFERENT=1)
