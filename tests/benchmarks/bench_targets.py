"""Kernels for a level of x86-64 beside those for this very processor: `python -m tests.benchmarks.bench_targets`.

A process for each target computes cycles whenever it is asked, in turns, so that both see the same load.
"""

from __future__ import annotations

import os
import subprocess
import sys
from statistics import median

import llvmlite.binding

from compd.kernel_target import LEVELS
from tests.benchmarks.bench_cycle import whole_cycles
from tests.benchmarks.figures import quiet, show
from tests.benchmarks.limits import run_limited

ROUNDS = 5
CASES = [(name, mode, 3) for name in ("tripod-cmm.yaml", "hexapod.yaml") for mode in ("cmm", "machine_tool")]
HEAD = ["snapshot to bytes, 3 effects", *(f"{target}, median us" for target in (*LEVELS, "native"))]
HEAD += [f"{level} / native" for level in LEVELS]


def main() -> None:
    """Compile for each target where that is not done yet, measure in turns, and print the ratios."""
    native = (llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten())
    targets = {**{level: (level, "") for level in LEVELS}, "native": native}
    processes = {name: _started(*target) for name, target in targets.items()}
    rows = []
    for case in range(len(CASES)):
        medians_us: dict[str, list[float]] = {name: [] for name in processes}
        for _ in range(ROUNDS):
            for name, process in processes.items():
                medians_us[name].append(_asked(process, case))
        # of each round: its targets were beside the same other work
        ratios = {
            level: median(a / b for a, b in zip(medians_us[level], medians_us["native"], strict=True))
            for level in LEVELS
        }
        name, mode, _ = CASES[case]
        rows.append(
            [
                f"{name.removesuffix('.yaml')}, {mode}",
                *(f"{median(values):.1f}" for values in medians_us.values()),
                *(f"{ratio:.2f}" for ratio in ratios.values()),
            ]
        )
    for process in processes.values():
        process.communicate()
    show("Kernels for a level of x86-64 beside those for this processor", HEAD, rows)


def _started(cpu: str, features: str) -> subprocess.Popen[str]:
    """A process with kernels for this target, which computes cycles when it is asked."""
    return subprocess.Popen(
        [sys.executable, "-m", "tests.benchmarks.bench_targets", "computes"],
        env=os.environ | {"NUMBA_CPU_NAME": cpu, "NUMBA_CPU_FEATURES": features},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _asked(process: subprocess.Popen[str], case: int) -> float:
    """The median (us) of cycles that the process computes now."""
    assert process.stdin is not None
    assert process.stdout is not None
    print(case, file=process.stdin, flush=True)
    return float(process.stdout.readline())


def _computes() -> None:
    """Answer each number of a case with the median (us) of its cycles."""
    for line in sys.stdin:
        print(median(whole_cycles(*CASES[int(line)])) * 1e6, flush=True)


if __name__ == "__main__":
    quiet()
    if sys.argv[1:] == ["computes"]:
        _computes()
    else:
        run_limited(main, ROUNDS=1, CASES=CASES[:1])
