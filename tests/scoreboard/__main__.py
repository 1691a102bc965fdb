"""`python -m tests.scoreboard`: prepare cases, diagnose them on all cores, print the tables.

With --set the cases of that set are made, where they are not on disk, and diagnosed; without it, those that are in
--campaigns. Every result is a line of --out, written when its case is done: a run that was interrupted goes on.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from tests.scoreboard.cases import FAMILIES, FIRST_SEED, Case, cases, parse_case
from tests.scoreboard.real import FAMILY as REAL
from tests.scoreboard.real import PLACE, prepare_real
from tests.scoreboard.table import report
from tests.scoreboard.trial import prepared, read_answer, run

Item = TypeVar("Item")
Failures = list[tuple[str, str]]


def main() -> None:
    options = _options()
    options.campaigns.mkdir(parents=True, exist_ok=True)
    directories, failed = _directories(options)
    results: list[dict[str, Any]] = []
    if not options.prepare:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        failed += _diagnose(directories, options)
        wanted = {read_answer(directory)["case"] for directory in directories}
        results = [result for result in read_results(options.out) if result["case"] in wanted]
        print(report(results))
    print(f"\n{len(results)} of {len(directories)} cases diagnosed, {len(failed)} failed")
    for name, why in failed:
        print(f"failed: {name}: {why}")
    raise SystemExit(bool(failed))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.scoreboard", description=__doc__)
    add = parser.add_argument
    add("--set", choices=list(FIRST_SEED), help="prepare the cases of this set; without it, those on disk are used")
    add("--family", nargs="+", choices=[*FAMILIES, REAL], default=[*FAMILIES, REAL], help="these families alone")
    add("--case", action="append", help="this case alone, as the results name it; may be given again")
    add("--most", type=int, default=None, help="so many cases at most")
    add("--jobs", type=int, default=os.cpu_count(), help="side by side")
    add("--prepare", action="store_true", help="prepare the campaigns, and diagnose nothing")
    add("--campaigns", type=Path, default=Path("out/campaigns"), help="where they are kept")
    add("--real", type=Path, default=PLACE, help="where the recordings of real machines are, with answers.yaml")
    add("--out", type=Path, default=Path("out/scoreboard.jsonl"), help="results, one line each")
    return parser.parse_args()


def _directories(options: argparse.Namespace) -> tuple[list[Path], Failures]:
    """Directories of the wanted cases, which are prepared where that is asked for; and what failed."""
    real = [name for name in options.case or () if name.startswith(f"{REAL}:")]
    wanted: list[Case] = []
    if options.case:
        wanted = [parse_case(name) for name in options.case if name not in real]
    elif options.set:
        wanted = cases([name for name in options.family if name != REAL], options.set)
    if not wanted and not real and not options.set:
        found = [path for path in prepared(options.campaigns) if read_answer(path)["family"] in options.family]
        return found[: options.most], []
    with_real = bool(real) or (bool(options.set) and REAL in options.family)
    directories = prepare_real(options.campaigns, options.real) if with_real else []
    if real:
        directories = [path for path in directories if read_answer(path)["case"] in real]
    # the simulated machine is needed only where cases are made
    from tests.scoreboard.prepare import prepare

    todo = wanted[: options.most]
    work = partial(prepare, campaigns=options.campaigns)
    failed: Failures = []
    for case, outcome in in_parallel(work, todo, options.jobs, "preparing"):
        if isinstance(outcome, BaseException):
            failed.append((case.name, str(outcome)))
        else:
            directories.append(outcome)
    return directories, failed


def _diagnose(directories: Sequence[Path], options: argparse.Namespace) -> Failures:
    """Diagnose the cases that have no result yet."""
    done = {result["case"] for result in read_results(options.out)}
    todo = [directory for directory in directories if read_answer(directory)["case"] not in done]
    failed: Failures = []
    with options.out.open("a", encoding="utf-8") as file:
        for directory, outcome in in_parallel(run, todo, options.jobs, "diagnosing"):
            if isinstance(outcome, BaseException):
                failed.append((directory.name, f"{type(outcome).__name__}: {outcome}"))
                continue
            file.write(json.dumps(outcome) + "\n")
            file.flush()
    return failed


def read_results(path: Path) -> list[dict[str, Any]]:
    """Every result of the file; none where there is no file."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def in_parallel(work: Callable[[Item], Any], todo: Iterable[Item], jobs: int, what: str) -> Iterator[tuple[Item, Any]]:
    """(item, `work` of it or the error that it raised), in the order in which they are done."""
    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with ProcessPoolExecutor(jobs) as pool, Progress(*columns, transient=True) as progress:
        running = {pool.submit(work, item): item for item in todo}
        bar = progress.add_task("", total=len(running))
        for future in as_completed(running):
            progress.advance(bar)
            yield running[future], future.exception() or future.result()


if __name__ == "__main__":
    main()
