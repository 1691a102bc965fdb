"""One function over many items on a Dask cluster: results as they come, and an exception is a result.

Dask takes 5 ms for a task, so that quick items share one. An item whose worker died is tried once more by itself, when
nothing else runs: then it is known whether it is the item that kills workers.

Example::

    with open_cluster() as client:
        for outcome in outcomes(client, work, items):
            print(outcome.item, outcome.error or outcome.result)
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from compd.errors import CompdError, Problem

if TYPE_CHECKING:
    from distributed import Client, Future

Item = TypeVar("Item")
Result = TypeVar("Result")
# Longest time (s) of a cluster without workers; dead ones are restarted within it or never.
MAX_WITHOUT_WORKERS_S = 60.0
# Fewest tasks for each worker, so that the last ones are shared evenly.
_MIN_BATCHES = 8
# Interval (s) of checks for a worker while no result comes.
LOOK_EVERY_S = 5.0


@dataclass(frozen=True)
class Outcome(Generic[Item, Result]):
    """Outcome of an item: its result, or the error that it raised.

    An error that is a CompdError came from the work or says what happened to the cluster; any other is a defect.
    """

    item: Item
    result: Result | None
    error: Exception | None = None


def outcomes(
    client: Client, work: Callable[[Item], Result], items: Sequence[Item], batch: int = 1
) -> Iterator[Outcome[Item, Result]]:
    """Every item's outcome, in the order in which they are done.

    Parameters
    ----------
    client : distributed.Client
        Of the cluster that does the work.
    work : callable
        Of one item; it, the items and the results must be such that `pickle` takes them.
    items : sequence
        Each is done once, or twice where its worker died.
    batch : int
        So many items at most are one task; fewer where workers would be idle at the end.

    Yields
    ------
    Outcome
        One for each item. Where the caller leaves the loop, or Ctrl-C does, what is not done yet is cancelled.
    """
    workers = max(1, len(client.nthreads()))
    size = max(1, min(batch, len(items) // (workers * _MIN_BATCHES)))
    lost: list[Item] = []
    # every nth: neighbours, which may all be long, are in different tasks
    batches = math.ceil(len(items) / size)
    for outcome in _run(client, work, [items[k::batches] for k in range(batches)]):
        if isinstance(outcome.error, _WorkerDied):
            lost.append(outcome.item)
        else:
            yield outcome
    no_worker = False
    for item in lost:
        if no_worker:
            yield Outcome(item, None, _no_worker(item))
            continue
        for outcome in _run(client, work, [[item]]):
            no_worker = isinstance(outcome.error, _NoWorker)
            yield outcome


class _WorkerDied(CompdError):
    """The worker died while it had the item."""


class _NoWorker(CompdError):
    """There was no worker for the item."""


def _run(
    client: Client, work: Callable[[Item], Result], batches: Sequence[Sequence[Item]]
) -> Iterator[Outcome[Item, Result]]:
    """Every item's outcome, each batch tried once; leaving the loop cancels the rest."""
    futures = client.map(_attempt, [(work, batch) for batch in batches], pure=False)
    waiting = {future.key: (batch, future) for batch, future in zip(batches, futures, strict=True)}
    # `waiting` alone has them, so that the cluster forgets results that have been read
    del futures
    done: SimpleQueue[Future[Any]] = SimpleQueue()
    for _, future in waiting.values():
        future.add_done_callback(done.put)
    without_workers_s = 0.0
    try:
        while waiting and without_workers_s < MAX_WITHOUT_WORKERS_S:
            try:
                future = done.get(timeout=LOOK_EVERY_S)
            except Empty:
                without_workers_s = 0.0 if _has_worker(client) else without_workers_s + LOOK_EVERY_S
                continue
            batch, _ = waiting.pop(future.key)
            yield from _outcomes_of(batch, future)
        for batch, _ in waiting.values():
            yield from (Outcome(item, None, _no_worker(item)) for item in batch)
    finally:
        client.cancel([future for _, future in waiting.values()])


def _outcomes_of(batch: Sequence[Item], future: Future[Any]) -> list[Outcome[Item, Any]]:
    """The outcomes of items whose task is done or has failed."""
    from distributed import KilledWorker

    try:
        done = future.result()
    except KilledWorker as killed:
        worker = killed.last_worker.address
        return [Outcome(item, None, _worker_died(item, worker)) for item in batch]
    except CancelledError:
        return [Outcome(item, None, _scheduler_lost(item)) for item in batch]
    except Exception as error:  # noqa: BLE001 - what does not come back from a worker may be of any kind
        return [Outcome(item, None, _unreadable(item, error)) for item in batch]
    return [Outcome(item, result, error) for item, (result, error) in zip(batch, done, strict=True)]


def _has_worker(client: Client) -> bool:
    try:
        return bool(client.nthreads())
    except OSError:  # the scheduler does not answer
        return False


def _attempt(task: tuple[Callable[[Item], Result], Sequence[Item]]) -> list[tuple[Result | None, Exception | None]]:
    """A worker's task: the work on a few items; exceptions become values that every process can read."""
    work, batch = task
    done: list[tuple[Result | None, Exception | None]] = []
    for item in batch:
        try:
            done.append((work(item), None))
        except Exception as error:  # noqa: BLE001 - whatever one item raises, the others are worked on
            done.append((None, _portable(error)))
    return done


def _portable(error: Exception) -> Exception:
    """The error, or its text if it cannot be sent to another process."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # noqa: BLE001 - a class of its own may raise anything when it is made again
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _worker_died(item: object, worker: str) -> CompdError:
    return _WorkerDied(
        Problem(
            str(item),
            "the process that worked on it died",
            value=worker,
            next_step="the worker's log, or `dmesg`, says why: most often memory is short",
        )
    )


def _no_worker(item: object) -> CompdError:
    return _NoWorker(
        Problem(
            str(item),
            f"was not worked on: for {MAX_WITHOUT_WORKERS_S:g} s the cluster had no worker",
            next_step="start workers: `dask worker tcp://HOST:PORT`",
        )
    )


def _scheduler_lost(item: object) -> CompdError:
    return CompdError.of(
        str(item),
        "was not worked on: the scheduler has ended, or cannot be reached any more",
        next_step="start it again: `dask scheduler`",
    )


def _unreadable(item: object, error: Exception) -> CompdError:
    return CompdError.of(
        str(item),
        f"its worker cannot do this work: {type(error).__name__}: {error}",
        next_step="install on every worker the release of compd that runs here",
    )
