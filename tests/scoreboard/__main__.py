"""`python -m tests.scoreboard`: prepare cases, diagnose them on all cores, print the tables and write the page.

With --set the cases of that set are made, where they are not on disk, and diagnosed; without it, those that are in
--campaigns. Every result is a line of --out, written when its case is done: a run that was interrupted goes on.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from tests.scoreboard.case import Case
from tests.scoreboard.cases import FAMILIES, FIRST_SEED, cases, parse_case
from tests.scoreboard.page import write_page
from tests.scoreboard.parallel import append_results, in_parallel, read_results
from tests.scoreboard.real import FAMILY as REAL
from tests.scoreboard.real import PLACE, prepare_real
from tests.scoreboard.reliability import UNSTATED, reliability
from tests.scoreboard.table import report
from tests.scoreboard.trial import prepared, read_answer, run

# A case to prepare, or the directory of one that is prepared.
Item = Case | Path


def main() -> None:
    options = _options()
    options.campaigns.mkdir(parents=True, exist_ok=True)
    wanted = dict(_wanted(options))
    if options.prepare:
        outcomes = in_parallel(partial(_directory, campaigns=options.campaigns), list(wanted.values()), options.jobs)
        failed = [(str(outcome.item), str(outcome.error)) for outcome in outcomes if outcome.error]
    else:
        done = {result["case"] for result in read_results(options.out)}
        todo = [item for name, item in wanted.items() if name not in done]
        failed = append_results(options.out, partial(_run, campaigns=options.campaigns), todo, options.jobs)
        results = [result for result in read_results(options.out) if result["case"] in wanted]
        page = options.out.with_suffix(".html")
        write_page(page, results, options.campaigns)
        print(report(results))
        if options.figures:
            _write_figures(options.figures, results)
        print(f"\n{len(results)} of {len(wanted)} cases; those that are not right, with what was said: {page}")
    for name, why in failed:
        print(f"failed: {name}: {why}")
    raise SystemExit(bool(failed))


def _write_figures(path: Path, results: list[dict[str, Any]]) -> None:
    """Write the reliability as `docs.pictures.reliability` draws it."""
    found = reliability(results)
    if found is None:
        print(f"{path} is not written. {UNSTATED}")
        return
    path.write_text(json.dumps(found.as_json(), indent=1) + "\n", encoding="utf-8")


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
    add("--out", type=Path, default=Path("out/scoreboard.jsonl"), help="results; the page is written beside them")
    add("--figures", type=Path, default=None, help="write the reliability to this file of the documentation, too")
    return parser.parse_args()


def _wanted(options: argparse.Namespace) -> Iterator[tuple[str, Item]]:
    """Name and item of each wanted case."""
    if not options.case and not options.set:
        answers = ((read_answer(path), path) for path in prepared(options.campaigns))
        found = [(answer["case"], path) for answer, path in answers if answer["family"] in options.family]
        yield from found[: options.most]
        return
    is_real = {name: name.startswith(f"{REAL}:") for name in options.case or ()}
    if any(is_real.values()) or (not options.case and REAL in options.family):
        for path in prepare_real(options.campaigns, options.real):
            if is_real.get(name := read_answer(path)["case"], not options.case):
                yield name, path
    simulated = (
        [parse_case(name) for name, real in is_real.items() if not real]
        if options.case
        else cases([name for name in options.family if name != REAL], options.set)
    )
    yield from ((case.name, case) for case in simulated[: options.most])


def _directory(item: Item, campaigns: Path) -> Path:
    """Where the case is, which is prepared where it is not there yet."""
    if isinstance(item, Path):
        return item
    # the simulated machine is needed only where cases are made
    from tests.scoreboard.prepare import prepare

    return prepare(item, campaigns)


def _run(item: Item, campaigns: Path) -> dict[str, Any]:
    return run(_directory(item, campaigns))


if __name__ == "__main__":
    main()
