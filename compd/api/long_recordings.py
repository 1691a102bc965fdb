"""Recordings that are too long for the memory: compared block by block, and a sample of them for everything else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from compd.api.arguments import Model, opened_model
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.stream.block_comparison import compare_blocks
from compd.comparison.stream.recording_stream import open_stream
from compd.comparison.stream.sample import SAMPLE_ROWS, draw_sample
from compd.comparison.stream.streamed_comparison import StreamedComparison
from compd.configuration.shipped import Machine

# Called with the number of rows that are done, block after block.
Progress = Callable[[int], None]


def _silent(done: int) -> None:
    """Nobody watches."""


def compare_stream(
    path: str | Path, model: Model = None, *, machine: Machine | None = None, progress: Progress = _silent
) -> StreamedComparison:
    """Compare a recording of any length with the model of its machine, in constant memory; nothing is fitted.

    The recording is read twice: for a sample of 20,000 rows, then row by row.

    Parameters
    ----------
    path : str or Path
        The recording, NAME.parquet or NAME.csv, in the order of time.
    model : ModelFile, str or Path, optional
        As for `compare`.
    machine : str, Path or Configuration, optional
        As for `open_recording`.
    progress : callable
        Called with the number of rows that are done, after each block: twice the recording's rows at the end.

    Returns
    -------
    StreamedComparison
        As `compare` returns it. Its numbers are of all rows, the 95 % within 0.05 %; the noise floor, the trends, the
        limits of outliers and the prediction's uncertainty are of the sample, and so are arrays with a row for each
        row. `totals.envelope` is the residual over time: smallest, mean and largest of 2000 times.

    Raises
    ------
    RecordingError
        As `open_recording` and `compare`; and where `time_s` does not rise from row to row.
    StateError, CompdError
        As `compare`.

    Examples
    --------
    >>> import compd
    >>> comparison = compd.compare_stream("monday.csv")
    >>> comparison.rows, comparison.sample_rows  # of more than 20,000 rows the sample has 20,000
    (608, 608)
    >>> round(comparison.rms_um, 2)
    0.82
    """
    stream = open_stream(Path(path), machine)
    sample = draw_sample(stream, progress=progress)
    file = opened_model(model, sample.aligned)
    return compare_blocks(
        stream, sample, file.fitted, file.covariance, progress=lambda done: progress(sample.rows + done)
    )


def open_sample(
    path: str | Path, machine: Machine | None = None, *, rows: int = SAMPLE_ROWS, progress: Progress = _silent
) -> AlignedRecording:
    """Open a sample of a recording of any length, spread evenly; `diagnose`, `compare` and `add_effect` take it.

    Parameters
    ----------
    path : str or Path
        As for `compare_stream`.
    machine : str, Path or Configuration, optional
        As for `open_recording`.
    rows : int
        How many rows the sample has, about: rows of one visit stay together.
    progress : callable
        Called with the number of rows that are done, after each block.

    Returns
    -------
    AlignedRecording

    Raises
    ------
    RecordingError, ConfigurationError
        As `open_recording`.

    Examples
    --------
    >>> import compd
    >>> compd.open_sample("monday.csv", rows=100).recording.rows
    100
    """
    return draw_sample(open_stream(Path(path), machine), rows, progress=progress).aligned
