"""A diagnosis in a worker: the state behind its questions."""

from __future__ import annotations

import gzip
import io
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from compd.api import diagnose
from compd.comparison import open_whole_or_sample
from compd.configuration import Machine
from compd.diagnosis import Diagnosis
from compd.page.workbench.opened_recording import model_of
from compd.report import evidence

# Width of the text in columns, as on a usual terminal.
_WIDTH = 100


class Diagnosing:
    """`compd diagnose` of one recording."""

    kept = None

    def __init__(
        self,
        path: Path,
        model_path: Path | None,
        machine: Machine | None,
        effects: Sequence[str] = (),
        kept: None = None,
    ) -> None:
        """Arguments as for `DiagnosisJob`. Raises CompdError if the recording or the model cannot be opened."""
        self._aligned = open_whole_or_sample(path, machine)
        self._model, self._effects = model_of(model_path, self._aligned), effects
        self._diagnosis: Diagnosis | None = None

    def outcome(self, progress: Callable[[str], None]) -> dict[str, Any]:
        """The findings: `printed`, `result` and `evidence`. progress : called with each step as it begins."""
        self._diagnosis = diagnose(self._aligned, self._model, effects=self._effects, progress=progress)
        return {
            "printed": _printed(self._diagnosis),
            "result": self._diagnosis.as_json(),
            "evidence": evidence(self._diagnosis),
        }

    def page(self) -> bytes:
        """The page of the findings, compressed: the script for its figures is some megabytes."""
        from compd.report import write_diagnosis_page

        assert self._diagnosis is not None
        with TemporaryDirectory() as directory:
            path = Path(directory) / "diagnosis.html"
            write_diagnosis_page(path, self._diagnosis, [])
            return gzip.compress(path.read_bytes())


def _printed(diagnosis: Diagnosis) -> str:
    from rich.console import Console

    from compd.report import print_diagnosis

    text = io.StringIO()
    print_diagnosis(Console(file=text, width=_WIDTH, highlight=False), diagnosis, [])
    return text.getvalue()
