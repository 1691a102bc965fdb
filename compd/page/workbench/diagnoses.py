"""The running diagnoses of one page's server, limited in number."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from compd.errors import StateError
from compd.page.shares import ASKER, shares_of
from compd.page.workbench.diagnosis_job import DiagnosisJob
from compd.page.workers.workers import Workers

if TYPE_CHECKING:
    from compd.configuration import Machine

# Most diagnoses at once. Each takes a processor and the memory of a process, on the daemon's computer.
MAX_RUNNING = 8


class Diagnoses:
    """The running diagnoses."""

    def __init__(self, workers: Workers | None = None) -> None:
        """workers : of the same server."""
        self._workers = workers or Workers()
        self._lock = threading.Lock()
        self._running: list[DiagnosisJob] = []

    def begin(
        self, path: Path, model_path: Path | None, machine: Machine | None, revision: int, effects: Sequence[str] = ()
    ) -> DiagnosisJob:
        """Begin one; arguments as for `DiagnosisJob`. Raises StateError if the limit is reached."""
        with self._lock:
            self._running = [job for job in self._running if not job.has_ended]
            for share in shares_of(ASKER.get(), MAX_RUNNING):
                held = [job.path.stem for job in self._running if share.holds(job.token)]
                if len(held) >= share.most:
                    raise StateError.of(
                        "diagnosis",
                        f"{len(held)} run already on this server, of other recordings or models",
                        value=", ".join(held),
                        allowed=f"{share.most} at once {share.whose}".rstrip(),
                        next_step="wait for one of them to end, or cancel it where it was begun",
                    )
            job = DiagnosisJob(path, model_path, machine, revision=revision, effects=effects, workers=self._workers)
            self._running.append(job)
            return job
