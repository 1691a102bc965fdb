"""`python -m tests.injection.cells`: every fault in every situation, and pairs of faults.

Every result is a line of --out, written when its cell has ended: a run that was interrupted goes on.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from compd.cli.progress import count_shown
from tests.injection.cells.cell import Cell, all_cells, sample
from tests.injection.cells.report import report
from tests.injection.cells.workers import side_by_side
from tests.injection.measured import write_cells
from tests.scoreboard.parallel import read_results

# A sample checks a change, on whatever computer: what is wrong in it is tried twice more, and most of the three count.
# The whole of them is a measurement, in which nothing is tried again.
TRIED_AGAIN = 2


def main() -> int:
    """Print the tables; 1 where a cell is not as it must be, or could not be tried."""
    options = _options()
    cells = _wanted(options.sample, options.cell)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    if options.fresh:
        options.out.unlink(missing_ok=True)
    done = {result["cell"] for result in read_results(options.out)}
    failed = _try(options.out, [cell for cell in cells if cell.name not in done], options.jobs)
    results = _results(options.out, cells)
    wrong_names = {result["cell"] for result in results if result["problems"]}
    for _ in range(TRIED_AGAIN if options.sample else 0):
        failed += _try(options.out, [cell for cell in cells if cell.name in wrong_names], options.jobs)
    results = _results(options.out, cells)
    print(report(results))
    for name, why in failed:
        print(f"\ncould not be tried: {name}\n{why}")
    wrong = sum(bool(result["problems"]) for result in results)
    print(f"\n{len(results)} of {len(cells)} cells, {wrong} not as they must be; {options.out}")
    if options.write:
        write_cells(options.write, results)
    return 1 if wrong or failed else 0


def _results(out: Path, cells: Sequence[Cell]) -> list[dict[str, Any]]:
    """One of each cell, in the order of the file; of several one as most of them are."""
    tries: dict[str, list[dict[str, Any]]] = {cell.name: [] for cell in cells}
    for result in read_results(out):
        tries.get(result["cell"], []).append(result)
    by_verdict = [sorted(same, key=lambda result: bool(result["problems"])) for same in tries.values() if same]
    return [same[len(same) // 2] for same in by_verdict]


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.injection.cells", description=__doc__)
    add = parser.add_argument
    add("cell", nargs="*", help='these alone, as the results name them, or patterns: "scale-*@motion"')
    add("--sample", action="store_true", help="a part of them with something of every kind, in five minutes")
    add("--jobs", type=int, default=os.cpu_count(), help="machines side by side")
    add("--fresh", action="store_true", help="begin anew")
    add("--out", type=Path, default=Path("out/faults.jsonl"), help="results, a line for each cell")
    add("--write", type=Path, help="the file of the documentation: docs/faults.json")
    return parser.parse_args()


def _wanted(part: bool, patterns: Sequence[str]) -> list[Cell]:
    cells = all_cells()
    if part:
        cells = sample(cells)
    return [cell for cell in cells if not patterns or any(fnmatch(cell.name, pattern) for pattern in patterns)]


def _try(out: Path, cells: Sequence[Cell], jobs: int) -> list[tuple[str, str]]:
    """A line of the file for each; those that could not be tried, and why, are tried again by the next run."""
    failed: list[tuple[str, str]] = []
    if not cells:
        return failed
    with out.open("a", encoding="utf-8") as file, count_shown(len(cells), "cells") as shown:
        for number, tried in enumerate(side_by_side(cells, jobs), start=1):
            if tried.result is None:
                failed.append((tried.cell, tried.why))
            else:
                file.write(json.dumps(tried.result) + "\n")
                file.flush()
            shown(number)
    return failed


if __name__ == "__main__":
    raise SystemExit(main())
