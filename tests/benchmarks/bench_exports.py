"""How long a million rows of an instrument's export take: `python -m tests.benchmarks.bench_exports`.

Beside it, the time in which Python splits the same lines at their delimiter, without reading a number.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from compd.instruments import ReadOptions, read_export
from tests.benchmarks.figures import show
from tests.benchmarks.limits import run_limited

ROWS = 1_000_000
BUDGET_S = 10.0
SA_HEAD = (
    "// SpatialAnalyzer SA 2025.1 ( x64 )\n// Points Relative to Coordinate Frame 'A::WORLD'\n"
    "// AXES = CARTESIAN: X,  Y,  Z (mm)\n"
)


def main() -> None:
    with tempfile.TemporaryDirectory() as temporary:
        rows = []
        for name, delimiter, content in (
            ("time, x, y, z", ",", seconds()),
            ("German stamps and decimal commas", ";", german()),
            ("SpatialAnalyzer, whole seconds", ",", spatial_analyzer()),
        ):
            path = Path(temporary) / "export.txt"
            path.write_text(content, encoding="utf-8")
            begin = time.process_time()
            cells = [line.split(delimiter) for line in content.split("\n")]
            split_s = time.process_time() - begin
            del cells, content
            begin = time.process_time()
            count = len(read_export(path, ReadOptions()).line)
            read_s = time.process_time() - begin
            assert count == ROWS
            rows.append([name, f"{read_s:.1f}", f"{read_s / split_s:.1f}", f"{read_s / BUDGET_S:.2f}"])
        show(
            f"Exports of {ROWS} rows, processor time; budget {BUDGET_S:g} s",
            ["", "s", "/ splitting the lines", "/ budget"],
            rows,
        )


def position(row: int) -> tuple[float, float, float]:
    """mm."""
    return 1200 + row * 1e-4, -300 + row * 1e-5, 80 - row * 1e-5


def seconds() -> str:
    rows = ("{:.3f},{:.6f},{:.6f},{:.6f}".format(row * 0.001, *position(row)) for row in range(ROWS))
    return "\n".join(["time_s,x_mm,y_mm,z_mm", *rows]) + "\n"


def german() -> str:
    rows = (
        "12.02.2025 {}.{:03};{:.6f};{:.6f};{:.6f}".format(clock(row // 1000), row % 1000, *position(row))
        for row in range(ROWS)
    )
    return "Zeit;X [mm];Y [mm];Z [mm]\n" + "\n".join(rows).replace(".", ",").replace("12,02,", "12.02.") + "\n"


def spatial_analyzer() -> str:
    rows = (
        "A,  P1,  {},  {:.6f},  {:.6f},  {:.6f},  02/12/25 {}".format(row, *position(row), clock(row // 100))
        for row in range(ROWS)
    )
    return SA_HEAD + "\n".join(rows) + "\n"


def clock(second: int) -> str:
    """A time of day after 16:00."""
    return f"{16 + second // 3600:02}:{second // 60 % 60:02}:{second % 60:02}"


if __name__ == "__main__":
    run_limited(main, ROWS=100)
