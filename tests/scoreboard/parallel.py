"""Work on many items side by side, with a line of a file for each result: a run that was interrupted goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any, TypeVar

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

Item = TypeVar("Item")
# Name of an item, and the error that it raised.
Failures = list[tuple[str, str]]


def in_parallel(
    work: Callable[[Item], Any], todo: Sequence[Item], jobs: int
) -> Iterator[tuple[Item, Any, BaseException | None]]:
    """(item, `work` of it, the error that it raised), in the order in which they are done."""
    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with ProcessPoolExecutor(jobs) as pool, Progress(*columns, transient=True) as progress:
        running = {pool.submit(work, item): item for item in todo}
        bar = progress.add_task("", total=len(todo))
        for future in as_completed(running):
            progress.advance(bar)
            error = future.exception()
            yield running[future], None if error else future.result(), error


def append_results(path: Path, work: Callable[[Item], Any], todo: Sequence[Item], jobs: int) -> Failures:
    """Append `work` of each item to the file as it is done; returns what failed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    failed: Failures = []
    with path.open("a", encoding="utf-8") as file:
        for item, result, error in in_parallel(work, todo, jobs):
            if error is not None:
                failed.append((str(item), f"{type(error).__name__}: {error}"))
                continue
            file.write(json.dumps(result) + "\n")
            file.flush()
    return failed


def read_results(path: Path) -> list[dict[str, Any]]:
    """Every result of the file; none where there is no file."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
