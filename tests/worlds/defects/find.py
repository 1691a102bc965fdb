"""How soon fresh worlds find each defect again.

A seed is played with the patch of a defect, until an invariant does not hold. The last seconds of its plan are played
again: the defect is found where the invariant fails in them with the patch, and holds without. D, which has no patch,
is found where its invariant fails in them, and holds without its kinds of fault.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import AbstractContextManager, ExitStack
from types import TracebackType
from typing import NamedTuple

from tests.worlds.command import Order
from tests.worlds.defects.described import DEFECTS, PATCHES, Defect
from tests.worlds.defects.patched import Patched, patched, started
from tests.worlds.defects.play import Mark
from tests.worlds.plan import Plan

# How much of a plan before a failure is played again, s: the second where the first does not fail.
BEFORE_S = (15.0, 60.0)
AFTER_S = 1.0
# A failure that was no defect lasts for so long, s.
LASTS_S = 10.0

# When an invariant fails first in a plan, s; None where it holds.
Fails = Callable[[Plan, str], float | None]


class Search(NamedTuple):
    """minutes : simulated, until a search ends. rates, machine : as of `python -m tests.worlds`."""

    minutes: float = 60.0
    rates: str = "campaign"
    machine: str = ""

    def order(self, seed: int) -> Order:
        return Order(seed, self.minutes, self.rates, self.machine)

    def arguments(self, seed: int) -> list[str]:
        return [str(seed), f"{self.minutes:g}", self.rates, *([self.machine] if self.machine else [])]


class Found(NamedTuple):
    """minutes : simulated; until the search ended where `mark` is None. plan : that shows the defect."""

    defect: str
    seed: int
    minutes: float
    mark: Mark | None = None
    plan: Plan | None = None


class Played(AbstractContextManager["Played"]):
    """A world in a process of its own, which goes on when asked. time_s : until which its marks are known."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.time_s = 0.0
        self._process = process

    def marks(self) -> Iterator[Mark]:
        """What does not hold, as it comes. Raises RuntimeError where the world's process has failed."""
        reading, writing = self._process.stdout, self._process.stdin
        assert reading is not None
        assert writing is not None
        while answer := reading.readline():
            told = json.loads(answer)
            self.time_s = told["time_s"]
            yield from (Mark(*mark) for mark in told["marks"])
            writing.write("\n")
            writing.flush()
        if self._process.wait():
            raise RuntimeError(f"a world has ended with {self._process.returncode}")

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._process.kill()
        self._process.communicate()


def search(names: Sequence[str], seeds: Sequence[int], how: Search, jobs: int = 2) -> Iterator[Found]:
    """Play every seed with each of the defects, `jobs` at once; each as soon as it is over."""
    with ExitStack() as stack:
        trees = {name: stack.enter_context(patched(PATCHES[name])) for name in names if name in PATCHES}
        pool = stack.enter_context(ThreadPoolExecutor(jobs))
        orders = [(name, seed) for seed in seeds for name in names]
        for future in as_completed([pool.submit(_search, *order, how, trees.get(order[0])) for order in orders]):
            yield future.result()


def _search(name: str, seed: int, how: Search, tree: Patched | None) -> Found:
    defect, plan = DEFECTS[name], how.order(seed).plan
    start = started if tree is None else tree.start
    whole = without(defect, tree is not None)
    with Played(start("tests.worlds.defects.play", *how.arguments(seed))) as world:
        refused: dict[str, float] = {}
        try:
            for mark in world.marks():
                if mark.time_s - refused.get(mark.what, -LASTS_S) < LASTS_S or not _may_be(defect, mark):
                    continue
                shown = shows(plan, mark, lambda part, what: _fails(start, part, what), whole)
                if shown is not None:
                    return Found(name, seed, mark.time_s / 60, mark, shown)
                refused[mark.what] = mark.time_s
        except RuntimeError as error:  # the search of the others goes on
            print(f"{name}, seed {seed}: {error}", file=sys.stderr)
        return Found(name, seed, world.time_s / 60)


def without(defect: Defect, is_mended: bool) -> Fails:
    """Play a plan without a defect; where it is in the tree, without the kinds of fault that show it."""

    def fails(plan: Plan, what: str) -> float | None:
        if not is_mended:
            plan = plan.with_events(event for event in plan.events if event.name not in defect.beside)
        return _fails(started, plan, what)

    return fails


def shows(plan: Plan, mark: Mark, defective: Fails, whole: Fails) -> Plan | None:
    """The end of a plan in which the invariant of a mark fails with the defect, and holds without."""
    for before_s in BEFORE_S:
        part = ending(plan, mark.time_s + AFTER_S, before_s + AFTER_S)
        if defective(part, mark.what) is not None:
            return part if whole(part, mark.what) is None else None
        if mark.time_s <= before_s:
            return None
    return None


def ending(plan: Plan, end_s: float, lasts_s: float) -> Plan:
    """The last `lasts_s` (s) of a plan until `end_s` (s)."""
    begin_s = max(0.0, end_s - lasts_s)
    events = [e._replace(time_s=e.time_s - begin_s) for e in plan.events if begin_s <= e.time_s < end_s]
    return plan.with_events(events)._replace(duration_s=end_s - begin_s)


def _fails(start: Callable[..., subprocess.Popen[str]], plan: Plan, what: str) -> float | None:
    process = start("tests.worlds.defects.again", what)
    said, _ = process.communicate(plan.to_json())
    if process.returncode:
        raise RuntimeError(f"a world has ended with {process.returncode}")
    at_s: float | None = json.loads(said)
    return at_s


def _may_be(defect: Defect, mark: Mark) -> bool:
    """Whether the mark is of an invariant that finds the defect, beside one of its kinds of fault."""
    return mark.what in defect.invariants and bool(set(defect.beside) & set(mark.blame.split(", ")))
