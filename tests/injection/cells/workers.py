"""Cells on machines of their own, side by side: each result as soon as its cell has ended."""

from __future__ import annotations

import multiprocessing
import queue
import traceback
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from multiprocessing.context import SpawnContext
from multiprocessing.process import BaseProcess
from multiprocessing.queues import Queue
from typing import Any, NamedTuple

from tests.injection.cells.cell import Cell, all_cells
from tests.injection.cells.trial import try_cell
from tests.injection.rig import InjectedMachine
from tests.injection.truth import MOTION_EVERY_S
from tests.support.pauses import MATTERS_S, Pauses
from tests.support.simulated import run_directory

LOOK_EVERY_S = 1.0
TRIES = 3
# In a row: it is the computer then, and not a cell.
MAX_FAILURES = 3


class Tried(NamedTuple):
    """A cell that has ended. result : None where the trial itself has failed. why : of that failure."""

    cell: str
    result: dict[str, Any] | None
    why: str = ""


def side_by_side(cells: Sequence[Cell], jobs: int) -> Iterator[Tried]:
    """Each on one of `jobs` machines, which go from cell to cell; those that need the computer alone come last."""
    for alone in (False, True):
        # a machine that expands is another machine: together
        todo = sorted((cell for cell in cells if cell.alone is alone), key=lambda cell: cell.expands)
        if todo:
            yield from _tried(todo, 1 if alone else min(jobs, len(todo)))


def _tried(cells: Sequence[Cell], jobs: int) -> Iterator[Tried]:
    context = multiprocessing.get_context("spawn")
    todo, done = _queue(context), _queue(context)
    for cell in [*cells, *[None] * jobs]:
        todo.put(None if cell is None else cell.name)
    workers = [context.Process(target=_work, args=(todo, done)) for _ in range(jobs)]
    for worker in workers:
        worker.start()
    try:
        yield from _as_they_end(done, workers, {cell.name for cell in cells})
    finally:
        with suppress(queue.Empty):  # of what is left nothing is begun
            while True:
                todo.get_nowait()
        for _ in workers:
            todo.put(None)
        for worker in workers:
            worker.join()


def _as_they_end(done: Queue[Tried], workers: Sequence[BaseProcess], names: set[str]) -> Iterator[Tried]:
    while names:
        try:
            tried = done.get(timeout=LOOK_EVERY_S)
        except queue.Empty:
            if not any(worker.is_alive() for worker in workers):
                yield from (Tried(name, None, "the process that tries it has ended") for name in sorted(names))
                return
            continue
        names.discard(tried.cell)
        yield tried


def _queue(context: SpawnContext) -> Queue[Any]:
    return context.Queue()


def _work(todo: Queue[str | None], done: Queue[Tried]) -> None:
    """One machine at a time; anew where another is needed, or something went wrong with it."""
    by_name = {cell.name: cell for cell in all_cells()}
    pauses = Pauses()
    with pauses.watched(), ExitStack() as running:
        machine: InjectedMachine | None = None
        failures = 0
        while failures < MAX_FAILURES and (name := _next(todo)) is not None:
            cell = by_name[name]
            try:
                if machine is None or machine.expands is not cell.expands:
                    running.close()
                    machine = running.enter_context(_machine(cell.expands, running))
                done.put(Tried(name, _result(machine, cell, pauses)))
                failures = 0
            except Exception:  # noqa: BLE001 (whatever it is, the other cells go on)
                machine = None
                failures += 1
                done.put(Tried(name, None, traceback.format_exc()))


def _next(todo: Queue[str | None]) -> str | None:
    """The next cell; None where there is none, or nobody waits for it any more."""
    parent = multiprocessing.parent_process()
    while parent is None or parent.is_alive():
        with suppress(queue.Empty):
            return todo.get(timeout=LOOK_EVERY_S)
    return None


def _result(machine: InjectedMachine, cell: Cell, pauses: Pauses) -> dict[str, Any]:
    """Of a cell; it is tried again where it goes wrong while the computer itself pauses."""
    for tries_left in reversed(range(TRIES)):
        before_s = pauses.lost_s
        result = try_cell(machine, cell)
        paused_s = pauses.lost_s - before_s
        if not tries_left or paused_s < MATTERS_S or not result.problems:
            break
        pauses.settle()
    return result.as_data() | {"paused_s": round(paused_s, 3)}


def _machine(expands: bool, running: ExitStack) -> InjectedMachine:
    directory = running.enter_context(run_directory())
    return InjectedMachine(directory, truth_every_s=MOTION_EVERY_S, expands=expands)
