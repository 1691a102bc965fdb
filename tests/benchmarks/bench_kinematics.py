"""The kinematics alone, beside the same mathematics in C: `python -m tests.benchmarks.bench_kinematics`.

All ways are timed in one run, taking turns, so that what slows the computer down slows all of them alike. C and
Numba must agree, or no table is printed.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from compd.compensation import GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool
from compd.model.kinematics import distances_mm, forward_kinematics, solve_frame
from compd.rotation import to_inner
from tests.benchmarks.figures import median_and_p99, show
from tests.benchmarks.limits import run_limited
from tests.support.model_machines import inverse_pose, tripod

SOURCE = Path(__file__).with_name("kinematics.c")
ROWS = 10_000
CALLS = 20_000  # of one snapshot each
TURNS = 15  # the best of so many counts: the rest is what else the computer did
LIMIT_ROWS, LIMIT_SINGLE = 2.0, 8.0  # at most so many times C

Array = NDArray[Any]
MODEL = tripod()


class Task(NamedTuple):
    """One function of the physics, in both languages, on the same N rows.

    numba : takes the rows, or one of them.  c_function, shared : what the C function is called and takes besides.
    outputs : shape and type of each result's row.
    """

    numba: Callable[[Array], Sequence[Array]]
    rows: Array
    c_function: str
    shared_before: tuple[Array, ...]
    shared_after: tuple[Array, ...]
    outputs: tuple[tuple[tuple[int, ...], type], ...]


def tasks() -> Mapping[str, Task]:
    """Frame, forward and inverse kinematics of the tripod, from a warm start, as in the live loop."""
    rng = np.random.default_rng(1)
    frame, zero = MODEL.frame, MODEL.zero
    mechanism = MODEL.mechanism(zero.base_joints_M_mm)
    changes = zero.distances_mm + rng.normal(0, 0.02, (ROWS, 9))
    tips = zero.contact.tip_M_mm + rng.normal(0, 0.05, (ROWS, 3))
    lengths = zero.link_length_mm + rng.normal(0, 0.05, (ROWS, 3))
    start = zero.platform_origin_M_mm, zero.rotation_M_P
    integer, real = np.int64, np.float64
    counted = ((), integer), ((), real), ((), integer)
    pose = ((3,), real), ((3, 3), real), ((3,), real), *counted
    return {
        "frame from nine distances": Task(
            lambda rows: solve_frame(frame, rows),
            changes,
            "frame_rows",
            (),
            (
                frame.plate_points_M_mm,
                frame.zero_supports_M_mm,
                frame.joint_offsets_B_mm,
                frame.support_of_joint,
                frame.zero_origin_M_mm,
                frame.zero_rotation_M_B,
            ),
            (((3, 3), real), ((3,), real), ((3, 3), real), ((3, 3), real), ((3,), real), ((3,), real), *counted),
        ),
        "tripod forward": Task(
            lambda rows: forward_kinematics(mechanism, rows, *start),
            lengths,
            "forward_rows",
            mechanism[:3],
            start,
            pose,
        ),
        "tripod inverse": Task(
            lambda rows: inverse_pose(MODEL, mechanism, rows, zero.contact.tip_P_mm, zero.rotation_M_P),
            tips,
            "inverse_rows",
            mechanism[:3],
            (zero.contact.tip_P_mm, zero.rotation_M_P),
            pose,
        ),
    }


def compiled(directory: Path) -> ctypes.CDLL:
    """The C functions, compiled with gcc -O2."""
    library = directory / "kinematics.so"
    command = ["gcc", "-O2", "-shared", "-fPIC", "-w", str(SOURCE), "-o", str(library), "-lm"]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(library))


def in_c(library: ctypes.CDLL, task: Task) -> tuple[Callable[[int, int], None], list[Array]]:
    """A function of (rows, stride), and the arrays that it writes; stride 0 repeats the first row inside C."""
    results = [np.empty((ROWS, *shape), kind) for shape, kind in task.outputs]
    counts = [ctypes.c_long(MODEL.links)] if task.c_function == "frame_rows" else []
    arrays = [*task.shared_before, task.rows, *task.shared_after, *results]
    arguments = [*counts, *(ctypes.c_void_p(array.ctypes.data) for array in arrays)]
    function = getattr(library, task.c_function)
    function.restype = None

    def run(rows: int, stride: int) -> None:
        function(ctypes.c_long(rows), ctypes.c_long(stride), *arguments)

    return run, results


def seconds(action: Callable[[], object]) -> float:
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def compare(library: ctypes.CDLL, task: Task) -> dict[str, float]:
    """Microseconds per row: in one call of many rows, and in calls of one row."""
    run, results = in_c(library, task)
    run(ROWS, 1)
    pairs = list(zip(task.numba(task.rows), results, strict=True))
    del pairs[-3]  # how many steps each takes
    for ours, theirs in pairs:
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)
    one = task.rows[0]
    numba = task.numba

    def calls() -> None:
        for _ in range(CALLS):
            numba(one)

    ways: dict[str, tuple[Callable[[], object], int]] = {
        "C rows": (lambda: run(ROWS, 1), ROWS),
        "Numba rows": (lambda: numba(task.rows), ROWS),
        "C single": (lambda: run(CALLS, 0), CALLS),
        "Numba single": (calls, CALLS),
    }
    best = dict.fromkeys(ways, np.inf)
    for _ in range(TURNS):
        for name, (action, count) in ways.items():
            best[name] = min(best[name], seconds(action) / count * 1e6)
    return best


def numpy_frame_us() -> float:
    """The frame alone by Newton in NumPy, for one snapshot: what there is without compiling."""
    plate, guess = MODEL.frame.plate_points_M_mm, MODEL.frame.zero_supports_M_mm
    wanted = MODEL.zero.distances_mm + 0.01
    near, far = np.array([0, 1, 2, 0, 0, 1, 1, 2, 2]), np.array([1, 2, 0, 3, 5, 3, 4, 4, 5])
    columns = np.arange(9)

    def solve() -> Array:
        supports = guess.copy()
        for _ in range(3):
            points = np.concatenate([supports, plate])
            edge = points[near] - points[far]
            length = np.sqrt((edge * edge).sum(-1))
            J = np.zeros((9, 6, 3))
            J[columns, near] = edge / length[:, None]
            J[columns, far] -= edge / length[:, None]
            supports += np.linalg.solve(J[:, :3].reshape(9, 9), wanted - length).reshape(3, 3)
        return supports

    np.testing.assert_allclose(distances_mm(solve(), plate)[0], wanted, rtol=0, atol=1e-9)
    return min(seconds(lambda: [solve() for _ in range(200)]) / 200 for _ in range(TURNS)) * 1e6


def compensation_us() -> list[list[str]]:
    """One whole compensation, gauge values to correction, as the loop calls it."""
    values = GaugeValues(np.array([1.0, -2.0, 0.5]), np.full(9, 0.002), np.full(9, 0.01), {})
    zero = WarmStart.at_zero(MODEL)
    target = to_inner(MODEL.frame.zero_rotation_M_B, MODEL.frame.zero_origin_M_mm, MODEL.zero.contact.tip_M_mm + 5.0)
    modes: dict[str, Callable[[WarmStart], tuple[Any, WarmStart]]] = {
        "CMM mode": lambda warm: compensate_cmm(MODEL, values, warm),
        "machine-tool mode": lambda warm: compensate_machine_tool(MODEL, target, None, values, warm),
    }
    rows = []
    for name, mode in modes.items():
        _, warm = mode(zero)
        durations = [seconds(lambda mode=mode, warm=warm: mode(warm)) * 1e6 for _ in range(CALLS)]
        rows.append([name, *(f"{value:.1f}" for value in median_and_p99(durations))])
    return rows


def main() -> None:
    if shutil.which("gcc") is None:
        sys.exit("bench_kinematics compares with C and needs gcc; on Debian and Ubuntu: apt-get install gcc")
    table = []
    with tempfile.TemporaryDirectory() as directory:
        library = compiled(Path(directory))
        for name, task in tasks().items():
            us = compare(library, task)
            many, single = us["Numba rows"] / us["C rows"], us["Numba single"] / us["C single"]
            table.append(
                [
                    name,
                    *(f"{us[key]:.2f}" for key in ("C rows", "Numba rows")),
                    f"{many:.2f}",
                    *(f"{us[key]:.2f}" for key in ("C single", "Numba single")),
                    f"{single:.2f}",
                ]
            )
    show(
        f"Kinematics, us per row, best of {TURNS}; limits {LIMIT_ROWS:g} x C in one call of {ROWS} rows, "
        f"{LIMIT_SINGLE:g} x C for one snapshot",
        ["", "C -O2, rows", "Numba, rows", "ratio", "C -O2, single", "Numba, single", "ratio"],
        table,
    )
    print(f"The frame in NumPy, one snapshot: {numpy_frame_us():.0f} us\n")
    show("Compensation, one snapshot of the tripod", ["", "median us", "p99 us"], compensation_us())


if __name__ == "__main__":
    run_limited(main, ROWS=10, CALLS=10, TURNS=1)
