"""`python -m tests.scoreboard`: prepare cases, diagnose them on all cores, print the tables.

With --set the cases of that set are made, where they are not on disk, and diagnosed; without it, those that are in
--campaigns. Every result is a line of --out, written when its case is done: a run that was interrupted goes on.
"""

from __future__ import annotations

import argparse
import os
from functools import partial
from pathlib import Path
from typing import Any

from tests.scoreboard.cases import FAMILIES, FIRST_SEED, Case, cases, parse_case
from tests.scoreboard.page import write_page
from tests.scoreboard.parallel import Failures, append_results, in_parallel, read_results
from tests.scoreboard.real import FAMILY as REAL
from tests.scoreboard.real import PLACE, prepare_real
from tests.scoreboard.table import report
from tests.scoreboard.trial import prepared, read_answer, run


def main() -> None:
    options = _options()
    options.campaigns.mkdir(parents=True, exist_ok=True)
    directories, failed = _directories(options)
    results: list[dict[str, Any]] = []
    if not options.prepare:
        wanted = {read_answer(directory)["case"]: directory for directory in directories}
        done = {result["case"] for result in read_results(options.out)}
        todo = [directory for case, directory in wanted.items() if case not in done]
        failed += append_results(options.out, run, todo, options.jobs, "diagnosing")
        results = [result for result in read_results(options.out) if result["case"] in wanted]
        print(report(results))
        page = options.out.with_suffix(".html")
        write_page(page, results, options.campaigns)
        print(f"\n{page}: every case that is not right, with what was hidden and what was said")
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
    for case, directory, error in in_parallel(work, todo, options.jobs, "preparing"):
        if error is None:
            directories.append(directory)
        else:
            failed.append((case.name, f"{type(error).__name__}: {error}"))
    return directories, failed


if __name__ == "__main__":
    main()
