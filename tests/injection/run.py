"""The fault matrix in virtual time: each fault at rest and what must happen, every fault in every situation, and pairs.

A trial has the name of its case ("scale-jumps"), or that of its cell ("scale-jumps@motion"). Each has a world of its
own from the same seed, so that it shows the same every time.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import traceback
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, NamedTuple

from compd.cli.progress import count_shown
from tests.injection.cells.cell import all_cells
from tests.injection.cells.report import report
from tests.injection.cells.trial import try_cell
from tests.injection.machine import Machine
from tests.injection.matrix import MATRIX, REAL
from tests.injection.measured import write
from tests.injection.rig import RealMachine
from tests.injection.trial import settle, try_case
from tests.injection.virtual import VirtualMachine
from tests.support.simulated import run_directory

# Trials of one process: what worlds map into its memory ends with it.
TASKS_PER_PROCESS = 20
# What `--sample` takes: one in eleven, so that all four situations and a machine without a fault are among them.
SAMPLE = slice(2, None, 11)


class Tried(NamedTuple):
    """A trial. result : None where it could not be tried. why : of that."""

    name: str
    result: dict[str, Any] | None
    why: str = ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables; 1 where a trial is not as it must be."""
    options = _options(arguments)
    names = sample(all_names()) if options.sample else all_names()
    if options.real:
        names = [case.id for case in (MATRIX if options.trial else REAL)]
    names = [name for name in names if not options.trial or any(fnmatch(name, one) for one in options.trial)]
    tried = _try_real(names) if options.real else _try(names, options.jobs)
    found = [(one.name, one.result) for one in tried if one.result is not None]
    outcomes = [result for name, result in found if "@" not in name]
    cells = [result for name, result in found if "@" in name]
    print(report(outcomes, cells))
    for failed in (one for one in tried if one.result is None):
        print(f"\ncould not be tried: {failed.name}\n{failed.why}")
    wrong = sum(bool(result["problems"]) for _, result in found) + len(tried) - len(found)
    print(f"\n{len(tried)} trials, {wrong} not as they must be")
    if options.write:
        write(options.write, outcomes, cells)
    return 1 if wrong else 0


def all_names() -> list[str]:
    """Names of all trials: cases of which something is demanded, then cells."""
    return [*(case.id for case in MATRIX if case.virtual), *(cell.name for cell in all_cells())]


def sample(names: Sequence[str]) -> list[str]:
    """A part of them with something of every kind."""
    return list(names[SAMPLE])


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.injection", description=__doc__)
    add = parser.add_argument
    add("trial", nargs="*", help='these alone, or patterns: "scale-*@motion"')
    add("--sample", action="store_true", help="a part of them with something of every kind")
    add("--real", action="store_true", help="with real ptys, sockets and processes: the sample, or cases by name")
    add("--jobs", type=int, default=os.cpu_count(), help="worlds side by side")
    add("--write", type=Path, help="the file of the documentation: docs/faults.json")
    return parser.parse_args(arguments)


def _try(names: Sequence[str], jobs: int) -> list[Tried]:
    """Try them side by side; in their order."""
    context = multiprocessing.get_context("spawn")
    tried = []
    with (
        # a ProcessPoolExecutor may wait for ever for a process that it replaces (python/cpython#115634)
        context.Pool(jobs, maxtasksperchild=TASKS_PER_PROCESS) as pool,
        count_shown(len(names), "trials") as shown,
    ):
        for number, one in enumerate(pool.imap(try_named, names), start=1):
            tried.append(one)
            shown(number)
    return tried


def _try_real(names: Sequence[str]) -> list[Tried]:
    """Try cases one after the other on a machine with real parts."""
    with run_directory() as directory, RealMachine(directory) as machine:
        return [Tried(name, _outcome(machine, name)) for name in names]


def try_named(name: str) -> Tried:
    """Try one, in a world of its own."""
    try:
        return Tried(name, _result(name))
    except Exception:  # noqa: BLE001 (whatever it is, the others go on)
        return Tried(name, None, traceback.format_exc())


def _result(name: str) -> dict[str, Any]:
    if "@" in name:
        return try_cell(next(cell for cell in all_cells() if cell.name == name)).as_data()
    with VirtualMachine() as machine:
        outcome = _outcome(machine, name)
        return outcome | {"problems": [*outcome["problems"], *machine.world.died]}


def _outcome(machine: Machine, name: str) -> dict[str, Any]:
    settle(machine)
    return try_case(machine, next(case for case in MATRIX if case.id == name)).as_data()
