"""What a diagnosis costs: `python -m tests.benchmarks.bench_diagnose`.

600 rows, every effect of the library; steps, searched constants, bootstrap and descriptions included.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from compd.diagnosis import diagnose
from compd.model.library import load_library
from tests.benchmarks.figures import show
from tests.benchmarks.limits import run_limited
from tests.support.hidden_effects import record_with_effects

VISITS = 480  # every fourth is repeated: 600 rows
BUDGET_S = 5.0
CASES: dict[str, dict[str, tuple[float, ...]]] = {
    "nothing hidden": {},
    "one effect": {"link_elasticity": (1 / 30,)},
    "one, with a searched constant": {"link_expansion_lag": (2.0,)},
    "three": {"link_elasticity": (1 / 30,), "scale_expansion": (9.0,), "backlash": (1.0, 0.9, 1.2)},
    "rivals, and rows that part them": {"tool_offset": (0.5, -0.4, 0.3)},
}


def main() -> None:
    """Print a table: wall and processor time of each case, and how often it fits into the budget."""
    effects = list(load_library().values())
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        diagnose(record_with_effects(path, 1, CASES["one effect"]), (), None, effects)  # compiles the kernels
        for name, hidden in CASES.items():
            aligned = record_with_effects(path, 1, hidden, visits=VISITS)
            wall_s, processor_s = time.perf_counter(), time.process_time()
            found = diagnose(aligned, (), None, effects)
            wall_s, processor_s = time.perf_counter() - wall_s, time.process_time() - processor_s
            rows.append(
                [
                    name,
                    found.verdict,
                    str(len(aligned.rows)),
                    f"{wall_s:.2f}",
                    f"{processor_s:.2f}",
                    f"{BUDGET_S / wall_s:.1f}",
                ]
            )
    title = f"A diagnosis with {len(effects)} effects, budget {BUDGET_S:g} s"
    show(title, ["hidden", "verdict", "rows", "wall, s", "processor, s", "budget / wall"], rows)


if __name__ == "__main__":
    run_limited(main, VISITS=48, CASES={"one effect": CASES["one effect"]})
