"""Opening a recording with its machine.

Example::

    from compd.comparison.recording_comparison import compare
    from compd.comparison.open import open_recording

    aligned = open_recording("run.csv")  # the machine's configuration is found by its name in the sidecar
    print(compare(aligned).verdict)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from compd.comparison.alignment.align_recording import align_recording
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.alignment.target_place import held_numbers
from compd.comparison.criteria import ComparisonCriteria
from compd.configuration import Configuration, Machine, load_machine, shipped_names
from compd.errors import Problem, RecordingError
from compd.parameter_ranges import read_range
from compd.recording import EXTERNAL, Recording, read_recording, read_sidecar
from compd.table_file import table_path


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
