"""A few workers of one kind, so that two persons can work at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from compd.page.workers.limits import WorkerLimits
from compd.page.workers.worker import Worker
from compd.page.workers.workers import Workers


class WorkerGroup:
    """Each worker has caches of its own."""

    def __init__(
        self, workers: Workers, count: int, name: str, opening: str, arguments: Sequence[Any], limits: WorkerLimits
    ) -> None:
        """count : of workers. The others as for `Worker`."""
        self._members = [workers.worker(name, opening, arguments, limits) for _ in range(count)]
        self._last_about: dict[Worker, str] = {}

    def free(self, about: str) -> Worker:
        """The worker with the fewest questions; among equals the one last asked about the same, or a running one."""

        def order(worker: Worker) -> tuple[int, bool, bool]:
            return worker.questions, self._last_about.get(worker) != about, worker.pid is None

        chosen = min(self._members, key=order)
        self._last_about[chosen] = about
        return chosen
