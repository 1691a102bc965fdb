"""What `compd compare` costs, from the files to the answer: `python -m tests.benchmarks.bench_compare`.

Beside it, the same forward kinematics row by row with SciPy's `least_squares`.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from compd.comparison import AlignedRecording
from compd.model.kinematics import closure_at
from tests.benchmarks.figures import show
from tests.benchmarks.limits import run_limited
from tests.support.measured import aligned, gauges, hidden, record

ROWS = (1_000, 10_000, 100_000)
BUDGET_S = 20.0
BUDGET_MB = 2048.0
SCIPY_ROWS = 300
FEW_ROWS = 100  # their time is that of Python, of imports and of compiled kernels
MIN_SHARE = 0.1  # of the start: less work than that is lost in how long starts take
# A process counts the memory of the one that started it as its own: it is started by a small one.
LAUNCHER = """
import json, os, sys, time
begin = time.perf_counter()
pid = os.posix_spawnp(sys.argv[2], sys.argv[2:], os.environ)
_, status, usage = os.wait4(pid, 0)
seconds = time.perf_counter() - begin
figures = seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss
os.write(int(sys.argv[1]), json.dumps(figures).encode())
sys.exit(os.waitstatus_to_exitcode(status))
"""
COMMAND = "import sys; from compd.cli import main; sys.argv[0] = 'compd'; main()"


class Cost(NamedTuple):
    """Wall time, processor time (which a busy machine does not stretch), largest resident memory."""

    seconds: float
    processor_s: float
    largest_MB: float


def main() -> None:
    with tempfile.TemporaryDirectory() as temporary:
        directory = Path(temporary)
        rows = []
        before = 0.0
        few = record(directory, gauges(FEW_ROWS, 1), name="few")
        start = command(["compare", str(few), "--json"]).processor_s
        for count in ROWS:
            path = record(directory, gauges(count, 1), [hidden("link_expansion", 1.1)], name=f"rows{count}")
            bare = command(["compare", str(path), "--json"])
            page = command(["compare", str(path), "--json", "--html", str(directory / "page.html")])
            work = bare.processor_s - start
            plain = work > MIN_SHARE * start
            growth = [
                f"{work / (count - FEW_ROWS) * 1e6:.1f}" if plain else "-",
                f"{work / before:.1f}" if before else "-",
            ]
            rows.append(
                [
                    f"{count}",
                    f"{bare.seconds:.2f}",
                    f"{bare.processor_s:.2f}",
                    *growth,
                    f"{bare.largest_MB:.0f}",
                    f"{page.seconds:.2f}",
                    f"{page.seconds / BUDGET_S:.2f}",
                    f"{page.largest_MB / BUDGET_MB:.2f}",
                ]
            )
            before = work if plain else 0.0
        show(
            f"compd compare, start of Python included; budget {BUDGET_S:g} s, {BUDGET_MB:g} MB at {ROWS[-1]} rows",
            [
                "rows",
                "s",
                "processor s",
                "processor us/row beyond the start",
                "times the line above",
                "MB",
                "with --html, s",
                "/ budget",
                "memory / budget",
            ],
            rows,
        )
        compare_with_scipy(aligned(directory / f"rows{ROWS[0]}.csv"))


def command(arguments: list[str]) -> Cost:
    """Run `compd` in a process of its own."""
    return cost([sys.executable, "-c", COMMAND, *arguments])


def cost(arguments: list[str]) -> Cost:
    """Run a command in a process of its own."""
    with tempfile.TemporaryFile() as usage:
        command = [sys.executable, "-S", "-c", LAUNCHER, str(usage.fileno()), *arguments]
        output = subprocess.run(command, stdout=subprocess.PIPE, pass_fds=[usage.fileno()], check=True).stdout
        usage.seek(0)
        seconds, processor_s, largest_kB = json.loads(usage.read())
    if "--json" in arguments:
        assert json.loads(output)["rows_used"] > 0
    return Cost(seconds, processor_s, largest_kB / 1024.0)


def compare_with_scipy(one: AlignedRecording) -> None:
    """One pose at a time, from machine zero, against the kernels over all rows."""
    assert one.model is not None
    zero = one.model.zero
    begin = time.perf_counter()
    for row in range(SCIPY_ROWS):
        mechanism = one.model.mechanism(one.rows.base_joints_M_mm[row])
        wanted_mm = one.rows.link_mm[row]

        def miss(x, mechanism=mechanism, wanted_mm=wanted_mm):  # type: ignore[no-untyped-def]
            R = Rotation.from_rotvec(x[3:]).as_matrix() @ zero.rotation_M_P
            closed = closure_at(mechanism, zero.platform_origin_M_mm + x[:3], R)
            return np.concatenate([closed.length_mm - wanted_mm, closed.offset_mm])

        found = least_squares(
            miss, np.zeros(6), x_scale=[1, 1, 1, 0.01, 0.01, 0.01], xtol=1e-14, ftol=1e-14, gtol=1e-14
        )
        assert np.abs(zero.platform_origin_M_mm + found.x[:3] - one.rows.origin_M_mm[row]).max() < 1e-6
    by_scipy_s = (time.perf_counter() - begin) / SCIPY_ROWS
    begin = time.perf_counter()
    repeats = 20
    for _ in range(repeats):
        one.predicted_mm({})
    by_compd_s = (time.perf_counter() - begin) / (repeats * len(one.rows))
    show(
        "Forward kinematics, one row",
        ["", "us/row", "ratio"],
        [
            ["compd, frame and links, all rows at once", f"{by_compd_s * 1e6:.2f}", "1"],
            ["scipy.optimize.least_squares, links alone", f"{by_scipy_s * 1e6:.0f}", f"{by_scipy_s / by_compd_s:.0f}"],
        ],
    )


if __name__ == "__main__":
    run_limited(main, ROWS=(1_000, 2_000), SCIPY_ROWS=3)
