"""Reading a recording: NAME.csv or NAME.parquet with NAME.yaml as a Recording, or every problem in them at once."""

from __future__ import annotations

from pathlib import Path

from compd.configuration import Configuration
from compd.recording.recording import Recording
from compd.recording.recording_builder import RecordingBuilder
from compd.table_file import read_table_file, table_path
from compd.tables import ProblemList


def read_recording(path: Path, configuration: Configuration | None = None, needs_reference: bool = True) -> Recording:
    """Read and check the recording `path` (NAME.csv or NAME.parquet) with its sidecar NAME.yaml beside it.

    configuration : the machine that it must fit; without one, only the files are compared with each other.
    needs_reference : False admits gauges alone (no `reference:` in the sidecar), for `compd join`.

    Raises RecordingError with every problem: file, row, column, value, what is allowed, next step.
    """
    path = table_path(path)
    builder = RecordingBuilder(path, configuration, needs_reference)
    problems = ProblemList(path)
    return builder.build(read_table_file(path, problems, builder.id_columns), problems)
