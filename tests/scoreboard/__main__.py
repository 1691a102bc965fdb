"""`python -m tests.scoreboard`: run the cases that are not in the results yet, on all cores; then print the tables.

Every result is a line of --out, written when its case is done, so that an interrupted run can be continued.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path
from typing import TextIO

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from tests.scoreboard.cases import KINDS, NOTHING, OUTSIDE, PAIRS, SEEDS, STRENGTHS, Case, cases, parse_cases
from tests.scoreboard.table import report
from tests.scoreboard.trial import prepare, run


def main() -> None:
    options = _options()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    wanted = (
        parse_cases(options.case)
        if options.case
        else cases(options.kinds, options.strengths, options.seeds, options.nothing, options.outside, options.pairs)
    )
    if options.prepare:
        failed = _in_parallel(prepare, wanted[: options.most], options, lambda _: None)
        raise SystemExit(str(failed) if failed else 0)
    with options.out.open("a+", encoding="utf-8") as file:
        failed = _in_parallel(run, _missing(wanted, options.out)[: options.most], options, partial(_write, file))
    results = [json.loads(line) for line in options.out.read_text(encoding="utf-8").splitlines()]
    names = {case.name for case in wanted}
    results = [result for result in results if result["case"] in names]
    print(f"\n{len(results)} of {len(wanted)} cases, {len(failed)} failed\n")
    print(report(results))
    for name, why in failed:
        print(f"\nfailed: {name}: {why}")
    raise SystemExit(bool(failed))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.scoreboard", description=__doc__)
    add = parser.add_argument
    add("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    add("--strengths", nargs="+", type=float, default=list(STRENGTHS), help="times the floor")
    add("--seeds", type=int, default=SEEDS, help="machines per effect and strength")
    add("--nothing", type=int, default=NOTHING, help="machines with nothing hidden")
    add("--outside", type=int, default=OUTSIDE, help="machines per cause outside the library")
    add("--pairs", type=int, default=PAIRS, help="machines with two effects")
    add("--case", action="append", help="this case alone, as the results name it; may be given again")
    add("--most", type=int, default=None, help="run so many cases at most")
    add("--jobs", type=int, default=os.cpu_count(), help="side by side")
    add("--prepare", action="store_true", help="make the campaigns alone, and keep them")
    add("--campaigns", type=Path, default=Path("out/campaigns"), help="where they are kept")
    add("--out", type=Path, default=Path("out/scoreboard.jsonl"))
    return parser.parse_args()


def _missing(wanted: Sequence[Case], out: Path) -> list[Case]:
    done = {json.loads(line)["case"] for line in out.read_text(encoding="utf-8").splitlines()}
    return [case for case in wanted if case.name not in done]


def _write(file: TextIO, result: object) -> None:
    file.write(json.dumps(result) + "\n")
    file.flush()


def _in_parallel(
    work: Callable[[Case, Path], object],
    todo: Sequence[Case],
    options: argparse.Namespace,
    done: Callable[[object], None],
) -> list[tuple[str, str]]:
    """Run `work` on every case; `done` is called with each result. Returns (name, error) of the cases that failed."""
    failed: list[tuple[str, str]] = []
    columns = (TextColumn("scoreboard"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with ProcessPoolExecutor(options.jobs) as pool, Progress(*columns, transient=True) as progress:
        bar = progress.add_task("", total=len(todo))
        running = {pool.submit(work, case, options.campaigns): case for case in todo}
        for future in as_completed(running):
            error = future.exception()
            if error is None:
                done(future.result())
            else:
                failed.append((running[future].name, str(error)))
            progress.advance(bar)
    return failed


if __name__ == "__main__":
    main()
