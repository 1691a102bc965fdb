"""The table of a running examination: results up to a moment before any end of the program are kept."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from compd.fleet.recording_result import RecordingResult
from compd.fleet.table import write_table

# Least interval (s) of writes. Writing the table of 500 recordings takes 20 ms; a diagnosis takes seconds.
WRITE_EVERY_S = 10.0


class Checkpoint:
    """Writes the table of the results so far, at most once in WRITE_EVERY_S.

    path : of the table.  monotonic : seconds of a clock that never goes back.
    """

    def __init__(self, path: Path, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._path = path
        self._monotonic = monotonic
        self._results: list[RecordingResult] = []
        self._written_s = monotonic()

    @property
    def count(self) -> int:
        """Results so far."""
        return len(self._results)

    def add(self, result: RecordingResult) -> None:
        """Take a result, and write the table if due."""
        self._results.append(result)
        now_s = self._monotonic()
        if now_s - self._written_s >= WRITE_EVERY_S:
            write_table(self._path, self._results)
            self._written_s = now_s
