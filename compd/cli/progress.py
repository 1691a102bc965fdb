"""Progress of long work on a terminal; silent elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Self, TypeVar

if TYPE_CHECKING:
    from pathlib import Path

    from compd.clock import Clock
    from compd.comparison import AlignedRecording

Item = TypeVar("Item")
# Interval (s) of updates of a number on the terminal.
_SHOWN_EVERY_S = 0.2


@contextmanager
def steps_shown(quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """A function to call at the beginning of each step; the bar is on standard error until the end."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (BarColumn(bar_width=20, pulse_style="bold"), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True, disable=quiet) as bar:
        task = bar.add_task("reading", total=None)
        yield lambda said: bar.update(task, description=said)


def open_shown(
    path: Path, machine: Path | None, ranges: Sequence[str] = (), hold: Sequence[str] = ()
) -> AlignedRecording:
    """The recording, or a sample of one that is too long for the memory, while the rows that are read are counted."""
    from compd.comparison import open_whole_or_sample

    with count_shown(None, f"reading {path.name}") as progress:
        return open_whole_or_sample(path, machine, ranges=ranges, hold=hold, progress=progress)


@contextmanager
def count_shown(total: int | None, what: str) -> Iterator[Callable[[int], None]]:
    """A function to call with the number done, out of `total` if known; the bar is on standard error meanwhile."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (BarColumn(bar_width=20), TextColumn(what), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=total)
        yield lambda done: bar.update(task, completed=done)


class ElapsedShown:
    """Progress of a measurement of a given time, or until Ctrl-C; a context manager."""

    def __init__(self, for_s: float | None, clock: Clock) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        self._clock = clock
        self._console = Console(stderr=True, soft_wrap=True, highlight=False, markup=False)
        columns = (BarColumn(bar_width=20), TextColumn("{task.description}"), TimeElapsedColumn())
        self._bar = Progress(*columns, console=self._console, transient=True, disable=not self._console.is_terminal)
        self._task = self._bar.add_task("", total=for_s)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def say(self, text: str) -> None:
        """Print a sentence on standard error, above the bar."""
        self._console.print(text)

    def show(self, items: Iterable[Item], so_far: Callable[[], str]) -> Iterator[Item]:
        """The items as they come; the time and `so_far()` are shown meanwhile."""
        start_s = shown_s = self._clock.monotonic()
        for item in items:
            now_s = self._clock.monotonic()
            if now_s - shown_s >= _SHOWN_EVERY_S:
                self._bar.update(self._task, completed=now_s - start_s, description=so_far())
                shown_s = now_s
            yield item
