"""Reading a recording: NAME.csv or NAME.parquet with NAME.yaml as a Recording, or every problem in them at once."""

from __future__ import annotations

from pathlib import Path

from compd.configuration import Configuration
from compd.errors import RecordingError
from compd.recording.layout import machine_problems
from compd.recording.recording import Recording
from compd.recording.recording_builder import RecordingBuilder
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


def check_against(recording: Recording, configuration: Configuration) -> None:
    """Raise RecordingError if the recording is of another machine, by its name or its number of gauges."""
    scales = 0 if recording.scale_mm is None else recording.scale_mm.shape[1]
    joints = 0 if recording.joint_mm is None else recording.joint_mm.shape[1]
    frame = 0 if recording.frame_mm is None else recording.frame_mm.shape[1]
    quantity = recording.reference.quantity if recording.reference else None
    where, commanded = str(recording.sidecar.path), recording.commanded_mm is not None
    counts = (scales, joints, frame)
    if problems := machine_problems(recording.machine, counts, quantity, configuration, where, commanded=commanded):
        raise RecordingError(problems)
