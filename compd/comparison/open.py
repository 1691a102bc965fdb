"""Opening a recording with its machine.

Example::

    from compd.comparison.recording_comparison import compare
    from compd.comparison.open import open_recording

    aligned = open_recording("run.csv")  # the machine's configuration is found by its name in the sidecar
    print(compare(aligned).verdict)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

from compd.comparison.alignment.align_recording import align_recording, align_sample
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.alignment.target_place import held_numbers
from compd.comparison.criteria import ComparisonCriteria
from compd.configuration import Configuration, Machine, load_machine, shipped_names
from compd.errors import Problem, RecordingError
from compd.parameter_ranges import read_range
from compd.recording import EXTERNAL, Recording, read_recording, read_sample, read_sidecar
from compd.table_file import row_count, table_path

# In memory a comparison takes 9 kB a row: more rows than these would take more than 2 GB.
LONG_ROWS = 200_000
# Called with the number of finished rows, block after block.
Progress: TypeAlias = Callable[[int], None]


def open_recording(
    path: str | Path,
    machine: Machine | None = None,
    *,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    ranges: Sequence[str] = (),
    hold: Sequence[str] = (),
) -> AlignedRecording:
    """Open a recording with its machine, and compute what the machine's kinematics predicts in each of its rows.

    Parameters
    ----------
    path : str or Path
        The recording, NAME.csv or NAME.parquet; its sidecar NAME.yaml lies beside it. The sidecar says which machine
        it is, and what the reference instrument measured.
    machine : str, Path or Configuration, optional
        The machine as `load_machine` takes it. Left out, the configuration that the sidecar names as `machine_file:`,
        or that comes with compd under the name in the sidecar; with ``machine: external`` in the sidecar there is none,
        and the prediction of your own model is read from the columns ``model_x_mm`` ...
    criteria : ComparisonCriteria
        The numbers by which the recording is aligned, compared and fitted; every one has its default.
    ranges : sequence of str
        Plausible ranges of single parameters, such as ``"link_zero.z=-3..3mm"``. Left out, geometric effects have the
        ranges that follow from the machine's ``geometry.tolerance_mm``, and all others those of the library.

    hold : sequence of str
        What of an instrument's registration is not fitted along: ``"frame"``, ``"target"``, ``"target.place"``,
        ``"target.attitude"``, or single numbers, ``"frame.x"`` to ``"target.c"``. The frame keeps what the first
        registration finds; a target that is held is at the tip, its axes along those of {P}.

    Returns
    -------
    AlignedRecording
        N rows with m measured coordinates each: x, y, z of the tip, or changes of link lengths.

    Raises
    ------
    RecordingError
        With every problem of the recording, its sidecar and the machine's name together: file, row, column, value,
        what is allowed and what to do.
    ConfigurationError
        Where the configuration `machine` cannot be used.
    CompdError
        Where a text of `ranges` states no range, or one of `hold` no part of a registration.

    Examples
    --------
    >>> import compd
    >>> recording = compd.open_recording("monday.csv")
    >>> recording.labels, recording.measured_mm.shape
    (('x', 'y', 'z'), (608, 3))
    """
    stated, held = tuple(map(read_range, ranges)), held_numbers(hold)
    recording, configuration = read_with_machine(Path(path), machine)
    return replace(align_recording(recording, configuration, criteria, held), ranges=stated)


def is_long(path: Path) -> bool:
    """Whether a recording has more rows than LONG_ROWS, so that a sample of it is opened.

    False for a file that cannot be read: who reads it whole says everything that is wrong.
    """
    try:
        return row_count(path) > LONG_ROWS
    except RecordingError:
        return False


def open_whole_or_sample(
    path: Path,
    machine: Machine | None = None,
    *,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    ranges: Sequence[str] = (),
    hold: Sequence[str] = (),
    progress: Progress = lambda rows: None,
) -> AlignedRecording:
    """Open the recording, by `open_sample` where it is too long for the memory; arguments and errors as there."""
    if not is_long(path):
        return open_recording(path, machine, criteria=criteria, ranges=ranges, hold=hold)
    return open_sample(path, machine, criteria=criteria, progress=progress, ranges=ranges, hold=hold)


def open_sample(
    path: str | Path,
    machine: Machine | None = None,
    *,
    rows: int | None = None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    progress: Progress = lambda rows: None,
    ranges: Sequence[str] = (),
    hold: Sequence[str] = (),
) -> AlignedRecording:
    """Open a sample of a recording of any length, spread evenly; `diagnose`, `compare` and `add_effect` take it.

    The file is read once, block by block. The same file gives the same sample.

    Parameters
    ----------
    path : str or Path
        The recording, NAME.parquet or NAME.csv, in the order of time.
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
        Its `recording.sample` says what is known of all rows.

    Raises
    ------
    RecordingError, ConfigurationError
        As `open_recording`; and where `time_s` does not rise from row to row.

    Examples
    --------
    >>> import compd
    >>> compd.open_sample("monday.csv", rows=100).recording.rows
    95
    """
    stated, held, path = tuple(map(read_range, ranges)), held_numbers(hold), Path(path)
    problems: list[Problem] = []
    configuration = recorded_machine(table_path(path), machine, problems)
    if problems:
        raise RecordingError(problems)
    most_rows = criteria.sample_rows if rows is None else rows
    recording = read_sample(path, configuration, most_rows, criteria.max_rows_of_visit, progress)
    return replace(align_sample(recording, configuration, criteria, held), ranges=stated)


def read_with_machine(
    path: Path, machine: Machine | None = None, needs_reference: bool = True
) -> tuple[Recording, Configuration | None]:
    """The recording and the configuration of its machine, which is None for an external model.

    machine : as in `open_recording`.  needs_reference : False accepts a recording without a reference.
    Raises RecordingError as `open_recording` does, CompdError where the file `machine` cannot be used.
    """
    path = table_path(path)
    problems: list[Problem] = []
    configuration = recorded_machine(path, machine, problems)
    try:
        recording = read_recording(path, configuration, needs_reference)
    except RecordingError as error:
        raise RecordingError([*problems, *error.problems]) from error
    if problems:
        raise RecordingError(problems)
    return recording, configuration


def recorded_machine(path: Path, machine: Machine | None, problems: list[Problem]) -> Configuration | None:
    """The configuration of a recording's machine: `machine`, else the one that its sidecar names; None for an external
    model.

    problems : gets one where no such configuration comes with compd.  Raises ConfigurationError as `load_machine`.
    """
    return _shipped(path.with_suffix(".yaml"), problems) if machine is None else load_machine(machine)


def _shipped(sidecar_path: Path, problems: list[Problem]) -> Configuration | None:
    """The configuration that the sidecar names by its file, or that comes with compd under the machine's name."""
    reported_by_the_reader: list[Problem] = []
    sidecar = read_sidecar(sidecar_path, reported_by_the_reader)
    if sidecar is None or sidecar.machine in ("", EXTERNAL):
        return None
    if sidecar.machine_file is not None:
        return load_machine(sidecar.machine_file)
    if sidecar.machine not in shipped_names():
        problems.append(
            Problem(
                str(sidecar_path),
                "no configuration of this machine comes with compd",
                value=repr(sidecar.machine),
                allowed=", ".join([*shipped_names(), EXTERNAL]),
                next_step="give the machine's configuration (--machine PATH, in Python machine=PATH), write its path "
                "as `machine_file:` into the sidecar, or mend `machine:` there",
            )
        )
        return None
    return load_machine(sidecar.machine)
