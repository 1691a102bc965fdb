"""A diagnosis in a process of its own: its steps as they begin, its result, and an end whenever a person wants it."""

from __future__ import annotations

import gzip
import io
import multiprocessing
import os
import secrets
import threading
from collections.abc import Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

from compd.clock import Clock, MonotonicClock
from compd.configuration.shipped import Machine
from compd.diagnosis.stages import ONLY_WHERE_NEEDED, STAGES
from compd.errors import CompdError

if TYPE_CHECKING:
    from compd.diagnosis.verdict import Diagnosis

# Columns of the text, as on a terminal of usual width.
_WIDTH = 100

State = Literal["running", "done", "cancelled", "failed"]


class DiagnosisJob:
    """`compd diagnose` of one recording; its attributes are read by other threads.

    Attributes
    ----------
    id : of this diagnosis and no other.
    revision : of the model and the rows that it is of.
    state : how far it is. Its pictures are drawn after it is "done".
    steps : text and time (s from the start) of each step that has begun.
    text, result, evidence : what the command prints, what it prints with ``--json``, and the same for a browser; empty
        before the end.
    """

    def __init__(
        self,
        path: Path,
        model_path: Path | None,
        machine: Machine | None,
        clock: Clock | None = None,
        revision: int = 0,
        effects: Sequence[str] = (),
    ) -> None:
        """model_path : of a model file that is there; None for no model. effects : files of effects, or names of
        those that come with compd, that are tried beside the library's."""
        self._clock = clock or MonotonicClock()
        self._start_s = self._clock.monotonic()
        self.id = secrets.token_hex(8)
        self.path, self.revision = path, revision
        self.state: State = "running"
        self.steps: list[tuple[str, float]] = []
        self.text = ""
        self.result: dict[str, Any] = {}
        self.evidence: dict[str, Any] = {}
        self._page = b""
        self._seconds: float | None = None
        context = multiprocessing.get_context("spawn")
        self._messages, theirs = context.Pipe(duplex=False)
        self._process = context.Process(
            target=_diagnose, args=(theirs, path, model_path, machine, effects), daemon=True
        )
        self._process.start()
        theirs.close()
        self._thread = threading.Thread(target=self._listen, name="diagnosis", daemon=True)
        self._thread.start()

    @property
    def has_ended(self) -> bool:
        """Whether its process has, and nothing more comes."""
        return not self._thread.is_alive()

    @property
    def page(self) -> bytes:
        """The page of ``compd diagnose --html``; empty before it is drawn."""
        return gzip.decompress(self._page) if self._page else b""

    def cancel(self) -> None:
        """End it, or the drawing of its pictures; without effect after its end."""
        if self.state == "running":
            self.state = "cancelled"
        self._process.terminate()

    def join(self, timeout_s: float | None = None) -> None:
        """Wait for its end."""
        self._thread.join(timeout_s)

    def summary(self) -> dict[str, Any]:
        """As plain data, without the result.

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
        """What it has found, as plain data."""
        return {"text": self.text, "result": self.result, "evidence": self.evidence}

    def _listen(self) -> None:
        try:
            while True:
                kind, content = self._messages.recv()
                if kind == "step":
                    self.steps.append((content, self._clock.monotonic() - self._start_s))
                elif kind == "page":
                    self._page = content
                elif self.state == "running":
                    self.text, self.result, self.evidence = content
                    self._seconds = self._clock.monotonic() - self._start_s
                    self.state = kind
        except (EOFError, OSError):
            if self.state == "running":
                self.text, self.state = "the process of the diagnosis has ended without a result", "failed"
        if self._seconds is None:
            self._seconds = self._clock.monotonic() - self._start_s
        self._process.join()
        self._messages.close()


def _diagnose(
    messages: Connection, path: Path, model_path: Path | None, machine: Machine | None, effects: Sequence[str]
) -> None:
    """In the process of its own."""
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    from compd.api.diagnosis import diagnose
    from compd.api.long_recordings import open_whole_or_sample
    from compd.page.workbench.evidence import evidence

    try:
        aligned, recorded_rows = open_whole_or_sample(path, machine)
        diagnosis = diagnose(aligned, model_path, effects=effects, progress=lambda text: messages.send(("step", text)))
    except CompdError as error:
        messages.send(("failed", (str(error), {}, {})))
        return
    messages.send(("done", (_text(diagnosis), diagnosis.as_json(), evidence(diagnosis))))
    messages.send(("page", _page(diagnosis, recorded_rows if aligned.recording.rows < recorded_rows else 0)))


def _end_with_the_parent() -> None:
    """The page's server may be killed, and then ends nobody."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _text(diagnosis: Diagnosis) -> str:
    from rich.console import Console

    from compd.report.diagnosis_text import print_diagnosis

    text = io.StringIO()
    print_diagnosis(Console(file=text, width=_WIDTH, highlight=False), diagnosis, [])
    return text.getvalue()


def _page(diagnosis: Diagnosis, recorded_rows: int) -> bytes:
    """The page, compressed: the script for its figures is some megabytes."""
    from compd.report.diagnosis_page import write_diagnosis_page

    with TemporaryDirectory() as directory:
        path = Path(directory) / "diagnosis.html"
        write_diagnosis_page(path, diagnosis, [], recorded_rows=recorded_rows)
        return gzip.compress(path.read_bytes())
