"""A diagnosis in a worker of its own: its steps as they begin, its result, and cancelling at any time."""

from __future__ import annotations

import json
import secrets
import threading
from collections.abc import Sequence
from concurrent.futures import Future
from contextvars import copy_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from compd.clock import MonotonicClock
from compd.diagnosis import ONLY_WHERE_NEEDED, STAGES
from compd.page.shares import ASKER
from compd.page.workers.limits import WorkerLimits
from compd.page.workers.workers import Workers
from compd.text import typeset

if TYPE_CHECKING:
    from compd.configuration import Machine

_STATE = "compd.page.workbench.diagnosing:Diagnosing"
# The worker ends as soon as its page is drawn.
LIMITS = WorkerLimits(memory_mb=2000, idle_s=1.0)
# Limits of a diagnosis; the longest known one took some minutes.
DIAGNOSIS_S = 1800.0
PAGE_S = 120.0

State = Literal["running", "done", "cancelled", "failed"]


class DiagnosisJob:
    """`compd diagnose` of one recording; its attributes are written by the worker's thread.

    Attributes
    ----------
    id : of this diagnosis and no other.
    revision : of the model and the rows that it is of.
    state : how far it is. Its pictures are drawn after it is "done".
    steps : text and time (s from the start) of each step that has begun.
    token : of the browser that has begun it.
    printed, result, evidence : what the command prints, what it prints with ``--json``, and the same for a browser;
        empty before the end.
    """

    def __init__(
        self,
        path: Path,
        model_path: Path | None,
        machine: Machine | None,
        revision: int = 0,
        effects: Sequence[str] = (),
        workers: Workers | None = None,
    ) -> None:
        """model_path : of a model file that is there; None for no model. effects : files of effects, or names of
        those that come with compd, that are tried beside the library's. workers : of the same server."""
        self._clock = MonotonicClock()
        self._start_s = self._clock.monotonic()
        self.id = secrets.token_hex(8)
        self.path, self.revision, self.token = path, revision, ASKER.get()
        self._context = copy_context()  # of the request: answers come in the worker's thread
        self.state: State = "running"
        self.steps: list[tuple[str, float]] = []
        self.printed = ""
        self.result: dict[str, Any] = {}
        self.evidence: dict[str, Any] = {}
        self._page = b""
        self._seconds: float | None = None
        self._ended = threading.Event()
        arguments = (path, model_path, machine, tuple(effects))
        self._worker = (workers or Workers()).worker(f"diagnosis of {path.stem}", _STATE, arguments, LIMITS)
        asked = self._worker.submit(f"{_STATE}.outcome", seconds=DIAGNOSIS_S, progress=self._note_step)
        asked.answer.add_done_callback(self._note_outcome)

    @property
    def has_ended(self) -> bool:
        """Whether the diagnosis has ended."""
        return self._ended.is_set()

    @property
    def page(self) -> bytes:
        """The page of ``compd diagnose --html``, compressed by gzip; empty before it is drawn."""
        return self._page

    def cancel(self) -> None:
        """Cancel it, or the drawing of its pictures; no effect after its end."""
        if self.state == "running":
            self.state = "cancelled"
        self._worker.end()

    def join(self, timeout_s: float | None = None) -> None:
        """Wait for its end."""
        self._ended.wait(timeout_s)

    def summary(self) -> dict[str, Any]:
        """The state as plain data, without the result.

        `page` : whether there is one, None while it may still come.
        """
        now_s = self._clock.monotonic() - self._start_s
        drawing = self.state in ("running", "done") and not self.has_ended
        return {
            "id": self.id,
            "state": self.state,
            "stages": [{"text": text, "only_where_needed": text in ONLY_WHERE_NEEDED} for text in STAGES],
            "steps": [{"text": text, "at_s": round(at_s, 2)} for text, at_s in self.steps],
            "seconds": round(now_s if self._seconds is None else self._seconds, 2),
            "page": True if self._page else None if drawing else False,
        }

    def outcome(self) -> dict[str, Any]:
        """The findings as plain data."""
        return {"printed": self.printed, "result": self.result, "evidence": self.evidence}

    def _note_step(self, text: str) -> None:
        self.steps.append((text, self._clock.monotonic() - self._start_s))

    def _note_outcome(self, answer: Future[bytes]) -> None:
        self._seconds = self._clock.monotonic() - self._start_s
        failure = None if answer.cancelled() else answer.exception()
        if self.state != "running" or answer.cancelled() or failure is not None:
            if self.state == "running":
                self.printed, self.state = typeset(str(failure)), "failed"
            self._ended.set()
            return
        outcome = json.loads(answer.result())
        self.printed, self.result, self.evidence = outcome["printed"], outcome["result"], outcome["evidence"]
        self.state = "done"
        asked = self._context.run(self._worker.submit, f"{_STATE}.page", seconds=PAGE_S)
        asked.answer.add_done_callback(self._note_page)

    def _note_page(self, answer: Future[bytes]) -> None:
        if not answer.cancelled() and answer.exception() is None:
            self._page = answer.result()
        self._ended.set()
