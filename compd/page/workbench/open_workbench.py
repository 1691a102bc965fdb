"""Open files of the page: a workbench in a worker, others for plans and doubts, and the newest diagnosis."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from compd.page.shares import ASKER
from compd.page.workbench.diagnoses import Diagnoses
from compd.page.workbench.diagnosis_job import DiagnosisJob
from compd.page.workers.limits import WorkerLimits
from compd.page.workers.worker import Worker
from compd.page.workers.workers import Workers

_WORKBENCH = "compd.page.workbench.workbench:Workbench"
# Opening of 500,000 rows took 7 s on two busy processors.
LIMITS = WorkerLimits(memory_mb=2000, opening_s=120.0, idle_s=600.0)
PLANNER_LIMITS = WorkerLimits(memory_mb=2000, opening_s=120.0, idle_s=300.0)
# Time (s) without a request from which a diagnosis has no browser any more: longer than a page takes to load anew.
LEFT_AFTER_S = 5.0
# Limits for a comparison, candidates, a card, a trial or a step; and for a plan or a doubt.
ANSWER_S, PLAN_S = 60.0, 300.0


class OpenWorkbench:
    """Used by the event loop's thread alone.

    diagnosis : the newest, which may run; None before the first.
    token : of the browser that has opened it.
    """

    def __init__(
        self, workers: Workers, diagnoses: Diagnoses, path: Path, model_path: Path, machine: Path | None
    ) -> None:
        """diagnoses : the running ones of the same server. machine : the page's configuration."""
        self._path = path
        self._diagnoses = diagnoses
        self.token = ASKER.get()
        # requests about the diagnosis: that wait for an answer, and that were answered
        self._followers = self._asked = 0
        self.diagnosis: DiagnosisJob | None = None
        arguments = (path, model_path, machine)
        self.worker: Worker = workers.worker(f"workbench of {path.stem}", _WORKBENCH, arguments, LIMITS)
        self.planner = workers.worker(f"plan for {path.stem}", _WORKBENCH, arguments, PLANNER_LIMITS)
        self._doubter = workers.worker(f"doubts about {path.stem}", _WORKBENCH, arguments, PLANNER_LIMITS)

    @property
    def libraries(self) -> list[str]:
        """The chosen files of effects."""
        return [] if self.worker.kept is None else list(self.worker.kept["libraries"])

    @property
    def is_busy(self) -> bool:
        """Whether a request waits for it."""
        return self.is_diagnosing or any(worker.questions for worker in (self.worker, self.planner, self._doubter))

    def rest(self) -> None:
        """End its processes, unless they work on a question; it waits for their end."""
        for worker in (self.worker, self.planner, self._doubter):
            worker.rest()

    async def ask(self, question: str, *given: Any, seconds: float = ANSWER_S) -> bytes:
        """The answer of the workbench. question : a method of `Workbench`, or the full name of a function.

        Raises as `Worker.ask`.
        """
        return await self.worker.ask(_full_name(question), *given, seconds=seconds)

    async def ask_planner(self, question: str, *given: Any, seconds: float = ANSWER_S) -> bytes:
        """As `ask`, in a second workbench: plans take minutes, and are cancelled."""
        return await self.planner.ask(_full_name(question), *given, seconds=seconds)

    async def doubt_of(self, effect: str) -> bytes:
        """See `Workbench.doubt`. A third workbench diagnoses while the others answer; the first alone has the drafts,
        whose names have an @."""
        if "@" in effect:
            return await self.ask("doubt", effect, self.libraries)
        return await self._doubter.ask(_full_name("doubt"), effect, self.libraries, seconds=PLAN_S)

    async def diagnose(self) -> None:
        """Begin a diagnosis unless one runs. Raises StateError if too many run in the server."""
        last = self.diagnosis
        if last is not None and last.state == "running":
            return
        diagnosed = json.loads(await self.ask("diagnosed"))
        if last is not None:
            last.cancel()  # its pictures may still be drawn
            await asyncio.to_thread(last.join)
        if self.diagnosis is not last:
            return  # another browser was quicker
        model, machine = (name and Path(name) for name in (diagnosed["model"], diagnosed["machine"]))
        self.diagnosis = self._diagnoses.begin(self._path, model, machine, self._revision, diagnosed["effects"])

    @property
    def is_diagnosing(self) -> bool:
        """Whether the newest diagnosis runs, or its pictures are drawn."""
        return self.diagnosis is not None and not self.diagnosis.has_ended

    @contextmanager
    def follower(self) -> Iterator[None]:
        """A browser follows the newest diagnosis meanwhile; LEFT_AFTER_S after the last one has gone it is ended."""
        job = self.diagnosis
        self._followers += 1
        try:
            yield
        finally:
            self._followers -= 1
            self._asked += 1
            if job is not None and not job.has_ended:
                asyncio.get_running_loop().call_later(LEFT_AFTER_S, self._end_if_left, job, self._asked)

    def _end_if_left(self, job: DiagnosisJob, asked: int) -> None:
        if not self._followers and self._asked == asked:
            asyncio.get_running_loop().run_in_executor(None, job.cancel)

    def diagnosis_summary(self, shown: str = "") -> dict[str, Any]:
        """The newest diagnosis: findings, changes since then (`behind`); `state` is "none" before the first.

        shown : id of that whose outcome the browser has already, which is left out.
        """
        job = self.diagnosis
        if job is None:
            return {"state": "none"}
        summary = {**job.summary(), "behind": self._revision - job.revision}
        return summary if shown == job.id else summary | job.outcome()

    @property
    def _revision(self) -> int:
        return 0 if self.worker.kept is None else int(self.worker.kept["revision"])


def _full_name(question: str) -> str:
    return question if ":" in question else f"{_WORKBENCH}.{question}"
