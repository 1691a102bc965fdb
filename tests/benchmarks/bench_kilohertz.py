"""The daemon at 1 kHz with ten effects: `python -m tests.benchmarks.bench_kilohertz [--seconds 60] [--rounds 5]`.

Runs of the daemon and of cyclictest take turns, so that what disturbs this computer disturbs both: the cycles that the
daemon missed stand beside the wake-ups that came a period late in cyclictest. A client in another process notes how old
each new reading is when the first setpoint with it arrives.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from compd.live import daemon as daemon_module
from tests.benchmarks.bench_cycle import EFFECTS
from tests.benchmarks.bench_latency import CLIENT, AllAtOnce
from tests.benchmarks.bench_loop import PRIORITY, configuration
from tests.benchmarks.figures import median_and_p99, quiet, show
from tests.benchmarks.limits import first_good, printed_lines, run_limited
from tests.support.live_models import file_with
from tests.support.running_daemon import supervised

RATE_HZ = 1000
PERIOD_US = 1_000_000 // RATE_HZ
# So small that no limit is reached.
PARAMETER = 0.01
SECONDS = 10
# A share of the readings, which come at 88 a second, is left for the start.
READINGS_PER_S = 60


class Run(NamedTuple):
    """One run of the daemon: cycles missed of all, and reading to client, s, median and 99 %."""

    missed: int
    median_s: float
    p99_s: float


def daemon_run(seconds: int) -> Run:
    """The daemon with ten effects for so long, and one client at full rate."""
    with tempfile.TemporaryDirectory(prefix="bench-") as directory:
        model = file_with(Path(directory) / "ten.model.yaml", *EFFECTS, **dict.fromkeys(EFFECTS, PARAMETER))
        settings = configuration(Path(directory), RATE_HZ)
        state = settings.state.model_copy(update={"model_file": str(model)})
        with supervised(replace(settings, state=state)) as daemon:
            setpoint = first_good(Path(directory) / "s")
            assert len(setpoint["sources_mm"]) == 2 + len(EFFECTS)
            missed = daemon.loop_process.timing.missed
            process = subprocess.Popen(
                [sys.executable, "-c", CLIENT, f"{directory}/s"], stdout=subprocess.PIPE, text=True
            )
            lines = printed_lines(process, READINGS_PER_S * seconds)
            missed = daemon.loop_process.timing.missed - missed
            process.terminate()
            process.communicate()
    return Run(missed, *median_and_p99([float(line.split()[2]) for line in lines]))


def cyclictest_run(seconds: int) -> int:
    """How many of cyclictest's wake-ups came a period late or later."""
    command = ["cyclictest", "--quiet", "--mlockall", f"--priority={PRIORITY}", f"--interval={PERIOD_US}"]
    command += [f"--loops={seconds * RATE_HZ}", f"--histogram={PERIOD_US}"]
    output = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    overflows = re.search(r"Histogram Overflows: *(\d+)", output)
    assert overflows is not None, output
    return int(overflows[1])


def measure(seconds: int, rounds: int, tell: Callable[[str], None]) -> list[tuple[Run, int]]:
    """Daemon and cyclictest in turns."""
    runs = []
    for number in range(rounds):
        runs.append((daemon_run(seconds), cyclictest_run(seconds)))
        tell(f"round {number + 1} of {rounds}: {runs[-1]}")
    return runs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=SECONDS)
    parser.add_argument("--rounds", type=int, default=1)
    options = parser.parse_args()
    if shutil.which("cyclictest") is None:
        print("cyclictest is not installed (apt-get install rt-tests): nothing is measured")
        return
    quiet()
    daemon_module.Acquisition = AllAtOnce  # type: ignore[misc, assignment]
    runs = measure(options.seconds, options.rounds, lambda text: print(text, file=sys.stderr))
    rows = [
        [
            f"{number}",
            f"{run.missed}",
            f"{late}",
            f"{run.median_s * RATE_HZ:.2f}",
            f"{run.p99_s * RATE_HZ:.2f}",
        ]
        for number, (run, late) in enumerate(runs, start=1)
    ]
    rows.append(["all", f"{sum(run.missed for run, _ in runs)}", f"{sum(late for _, late in runs)}", "", ""])
    show(
        f"1 kHz with {len(EFFECTS)} effects, {options.seconds} s each, in turns",
        ["round", "missed", "cyclictest late by a period", "reading to client, periods, median", "99 %"],
        rows,
    )


if __name__ == "__main__":
    run_limited(main, SECONDS=1, READINGS_PER_S=20)
