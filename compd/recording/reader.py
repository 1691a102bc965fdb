"""Reading a recording: NAME.csv or NAME.parquet with NAME.yaml as a Recording, or every problem in them at once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from compd.configuration import Configuration
from compd.recording.recording import Recording
from compd.recording.recording_builder import RecordingBuilder
from compd.recording.sample import draw_rows
from compd.table_file import read_table_file, table_path
from compd.tables import ProblemList


def read_recording(path: Path, configuration: Configuration | None = None, needs_reference: bool = True) -> Recording:
    """Read and check the recording `path` (NAME.csv or NAME.parquet) with its sidecar NAME.yaml beside it.

    configuration : the machine that it must fit; without one, only the files are compared with each other.
    needs_reference : False admits gauges alone (no `reference:` in the sidecar), for `compd recording join`.

    Raises RecordingError with every problem: file, row, column, value, what is allowed, next step.
    """
    path = table_path(path)
    builder = RecordingBuilder(path, configuration, needs_reference)
    problems = ProblemList(path)
    return builder.build(read_table_file(path, problems, builder.id_columns), problems)


def read_sample(
    path: Path,
    configuration: Configuration | None,
    most_rows: int,
    max_rows_of_visit: int,
    progress: Callable[[int], None] = lambda rows: None,
) -> Recording:
    """Read about `most_rows` rows of a recording of any length, with those before and after each.

    Only the rows `sample.row` of the result were drawn; speeds of theirs follow from the others. `sample` also has what
    is known of all rows. All rows are drawn where there are no more.

    max_rows_of_visit : of a longer visit so many rows, spread evenly, are drawn together.
    progress : called with the number of rows that are done, after each block.

    Raises RecordingError as `read_recording` does; and where `time_s` does not rise from row to row.
    """
    path = table_path(path)
    builder = RecordingBuilder(path, configuration, needs_reference=True)
    drawn = draw_rows(path, builder.id_columns, most_rows, max_rows_of_visit, progress)
    return builder.build(drawn.table, drawn.problems, drawn)
