"""Recordings too long for the memory: compared block by block, and sampled for everything else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from compd.api.arguments import Model, opened_model
from compd.api.diagnosis import with_tested_noise
from compd.arrays import FloatArray
from compd.comparison import (
    AlignedRecording,
    ComparisonCriteria,
    FitResult,
    RecordingStream,
    Sample,
    StreamedComparison,
    compare_blocks,
    draw_sample,
    fit_blocks,
    is_long,
    open_recording,
    open_stream,
)
from compd.configuration import Machine
from compd.model_changes import refit_model
from compd.model_file import ModelFile
from compd.parameter_ranges import read_range

# Called with the number of finished rows, block after block.
Progress = Callable[[int], None]


def _silent(done: int) -> None:
    """Default progress function: ignores it."""


class LongRecording(NamedTuple):
    """A recording that is too long for the memory, and its sample."""

    stream: RecordingStream
    sample: Sample

    def refine(self, result: FitResult, sigma_um: FloatArray, progress: Progress = _silent) -> FitResult:
        """A fit on the sample, with weights sigma_um (m,), fitted to all rows.

        progress : called with the number of rows that are done of each pass; there are two to five.
        """
        return fit_blocks(self.stream, self.sample, result, sigma_um, progress=progress)


def open_long(
    path: Path,
    machine: Machine | None = None,
    progress: Progress = _silent,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    *,
    ranges: Sequence[str] = (),
    hold: Sequence[str] = (),
) -> LongRecording:
    """Draw the sample of a recording; arguments and errors as of `open_sample`."""
    stream = open_stream(path, machine)
    sample = draw_sample(stream, criteria=criteria, progress=progress, hold=hold)
    return LongRecording(stream, replace(sample, aligned=_with_ranges(sample.aligned, ranges)))


def _with_ranges(aligned: AlignedRecording, ranges: Sequence[str]) -> AlignedRecording:
    return replace(aligned, ranges=tuple(map(read_range, ranges)))


def open_whole_or_sample(path: Path, machine: Machine | None = None) -> tuple[AlignedRecording, int]:
    """The recording (a sample of its rows if too long for the memory), and the number of rows in its file.

    Arguments and errors as of `open_recording`.
    """
    if not is_long(path):
        aligned = open_recording(path, machine)
        return aligned, aligned.recording.rows
    long = open_long(path, machine)
    return long.sample.aligned, long.sample.rows


def compare_stream(
    path: str | Path,
    model: Model = None,
    *,
    machine: Machine | None = None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    progress: Progress = _silent,
    hold: Sequence[str] = (),
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
    criteria : ComparisonCriteria
        As for `open_recording`.
    progress : callable
        Called with the number of rows that are done, after each block: twice the recording's rows at the end.
    hold : sequence of str
        As for `open_recording`.

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
    stream, sample = open_long(Path(path), machine, progress, criteria, hold=hold)
    file = opened_model(model, sample.aligned)
    return with_tested_noise(
        compare_blocks(stream, sample, file.fitted, file.covariance, progress=lambda done: progress(sample.rows + done))
    )


def open_sample(
    path: str | Path,
    machine: Machine | None = None,
    *,
    rows: int | None = None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    progress: Progress = _silent,
    ranges: Sequence[str] = (),
    hold: Sequence[str] = (),
) -> AlignedRecording:
    """Open a sample of a recording of any length, spread evenly; `diagnose`, `compare` and `add_effect` take it.

    Parameters
    ----------
    path : str or Path
        As for `compare_stream`.
    machine : str, Path or Configuration, optional
        As for `open_recording`.
    rows : int
        How many rows the sample has, about: rows of one visit stay together. Left out, `sample_rows` of the criteria,
        20,000.
    criteria : ComparisonCriteria
        As for `open_recording`.
    progress : callable
        Called with the number of rows that are done, after each block.
    ranges : sequence of str
        As for `open_recording`.
    hold : sequence of str
        As for `open_recording`.

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
    95
    """
    sample = draw_sample(open_stream(Path(path), machine), rows, criteria, progress, hold)
    return _with_ranges(sample.aligned, ranges)


def fit_stream(
    path: str | Path,
    model: ModelFile | str | Path,
    *,
    machine: Machine | None = None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    progress: Progress = _silent,
) -> ModelFile:
    """Fit all effects of a model again, to all rows of a recording of any length, in constant memory.

    Nonlinear constants stay as they are. `add_effect` adds an effect on a sample (`open_sample`), which this refines.

    Parameters
    ----------
    path : str or Path
        As for `compare_stream`.
    model : ModelFile, str or Path
        The model; it is not changed, nor is its file.
    machine : str, Path or Configuration, optional
        As for `open_recording`.
    criteria : ComparisonCriteria
        As for `open_recording`.
    progress : callable
        Called with the number of rows that are done of each pass: that of the sample, then two to five of the fit.

    Returns
    -------
    ModelFile
        The model with the new numbers, their standard errors and joint covariance. The errors in its ledger are of the
        sample.

    Raises
    ------
    RecordingError, StateError, CompdError
        As `compare_stream`, and where the model has no effect.

    Examples
    --------
    >>> import compd
    >>> model = compd.add_effect(None, "link_expansion", compd.open_sample("monday.csv", rows=200))
    >>> [round(number.value, 2) for number in compd.fit_stream("monday.csv", model).numbers()]
    [1.11]
    """
    long = open_long(Path(path), machine, progress, criteria)
    refine = partial(long.refine, progress=progress)
    return refit_model(opened_model(model, long.sample.aligned), long.sample.aligned, refine)
