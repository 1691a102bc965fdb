"""Work on many items side by side, with a line of a file for each result: a run that was interrupted goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

from compd.cli.progress import count_shown
from compd.fleet.cluster import open_cluster
from compd.fleet.engine import Outcome, outcomes

Item = TypeVar("Item")
# Name of an item, and the error that it raised.
Failures = list[tuple[str, str]]


def in_parallel(work: Callable[[Item], Any], todo: Sequence[Item], jobs: int) -> Iterator[Outcome[Item, Any]]:
    """The outcome of each item, in the order in which they are done."""
    if not todo:
        return
    with open_cluster(processes=jobs) as client, count_shown(len(todo), "cases") as done:
        for number, outcome in enumerate(outcomes(client, work, todo), start=1):
            done(number)
            yield outcome


def append_results(path: Path, work: Callable[[Item], Any], todo: Sequence[Item], jobs: int) -> Failures:
    """Append `work` of each item to the file as it is done; returns what failed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    failed: Failures = []
    with path.open("a", encoding="utf-8") as file:
        for outcome in in_parallel(work, todo, jobs):
            if outcome.error is not None:
                failed.append((str(outcome.item), f"{type(outcome.error).__name__}: {outcome.error}"))
                continue
            file.write(json.dumps(outcome.result) + "\n")
            file.flush()
    return failed


def read_results(path: Path) -> list[dict[str, Any]]:
    """Every result of the file; none where there is no file."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
