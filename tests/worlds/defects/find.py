"""How soon fresh worlds find each defect again.

A seed is played twice side by side, with a defect's patch and without. The defect is found where an invariant does not
hold that holds without the patch, within `NEAR_S` of the same time. D, which has no patch, is found where its invariant
does not hold beside its kinds of fault.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from functools import partial
from types import TracebackType
from typing import NamedTuple

from tests.worlds.defects.described import DEFECTS, PATCHES, Defect
from tests.worlds.defects.patched import Patched, patched, started
from tests.worlds.defects.play import STEP_S, Mark

# Two worlds of a seed may show the same failure so far apart, s.
NEAR_S = 10.0


class Search(NamedTuple):
    """minutes : simulated, until a search ends. rates, machine : as of `python -m tests.worlds`."""

    minutes: float = 60.0
    rates: str = "campaign"
    machine: str = ""

    def arguments(self, seed: int) -> list[str]:
        return [str(seed), f"{self.minutes:g}", self.rates, *([self.machine] if self.machine else [])]


class Found(NamedTuple):
    """minutes : simulated; until the search ended where `mark` is None."""

    defect: str
    seed: int
    minutes: float
    mark: Mark | None


class Played(AbstractContextManager["Played"]):
    """A world in a process of its own, which goes on when asked. time_s : until which `marks` are known."""

    def __init__(self, start: Callable[[], subprocess.Popen[str]]) -> None:
        self.time_s = 0.0
        self.marks: list[Mark] = []
        self.over = False
        self._process = start()

    def step(self) -> bool:
        """Let it go on; whether it did. Raises RuntimeError where the world's process has failed."""
        reading, writing = self._process.stdout, self._process.stdin
        assert reading is not None
        assert writing is not None
        answer = reading.readline()
        if not answer:
            self.over = True
            if self._process.wait():
                raise RuntimeError(f"a world has ended with {self._process.returncode}")
            return False
        told = json.loads(answer)
        self.time_s = told["time_s"]
        self.marks += [Mark(*mark) for mark in told["marks"]]
        writing.write("\n")
        writing.flush()
        return True

    def until(self, time_s: float) -> None:
        """Let it go on until `time_s` (s) or its end."""
        while not self.over and self.time_s < time_s:
            self.step()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._process.kill()
        self._process.communicate()


def search(names: Sequence[str], seeds: Sequence[int], how: Search) -> Iterator[Found]:
    """Play every seed with each of the defects."""
    with ExitStack() as stack:
        trees = {name: stack.enter_context(patched(PATCHES[name])) for name in names if name in PATCHES}
        for seed in seeds:
            with Played(partial(started, ["-m", "tests.worlds.defects.play", *how.arguments(seed)])) as whole:
                for name in names:
                    yield _search(name, seed, how, whole, trees.get(name))


def _search(name: str, seed: int, how: Search, whole: Played, tree: Patched | None) -> Found:
    defect = DEFECTS[name]
    if tree is None:
        mark = _first(whole, lambda mark: defect.invariant == mark.what and _beside(defect, mark))
        return Found(name, seed, mark.time_s / 60 if mark else whole.time_s / 60, mark)
    with Played(lambda: tree.start("tests.worlds.defects.play", *how.arguments(seed))) as defective:
        mark = _first(defective, lambda mark: not _also(whole, mark))
        return Found(name, seed, (mark.time_s if mark else defective.time_s) / 60, mark)


def _first(world: Played, counts: Callable[[Mark], bool]) -> Mark | None:
    """The first mark that counts."""
    looked = 0
    while True:
        while looked < len(world.marks):
            if counts(world.marks[looked]):
                return world.marks[looked]
            looked += 1
        if world.over:
            return None
        world.step()


def _also(whole: Played, mark: Mark) -> bool:
    """Whether the same did not hold in the world without the patch."""
    whole.until(mark.time_s + NEAR_S + STEP_S)
    return any(mark.what == other.what and abs(mark.time_s - other.time_s) <= NEAR_S for other in whole.marks)


def _beside(defect: Defect, mark: Mark) -> bool:
    return bool(set(defect.beside) & set(mark.blame.split(", ")))
