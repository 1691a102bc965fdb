"""Opening a recording with its machine, and a model file with the effects fitted so far.

Example::

    from compd.comparison.compare import compare
    from compd.comparison.open import open_model, open_recording

    aligned = open_recording(Path("run.csv"))               # the machine's configuration is found by its name
    model = open_model(Path("tripod.model.yaml"), aligned)  # None: no effect acts yet
    print(compare(aligned, model.fitted, model.covariance).verdict)
"""

from __future__ import annotations

import re
from pathlib import Path

from compd.comparison.aligned_recording import AlignedRecording, align_recording
from compd.configuration import Configuration, load
from compd.configuration.shipped import shipped_configuration
from compd.errors import CompdError, Problem, RecordingError
from compd.model_file import ModelFile, read_model_file
from compd.recording.reader import read_recording
from compd.recording.recording import Recording
from compd.recording.sidecar import EXTERNAL, read_sidecar


def open_recording(path: Path, machine: Path | None = None) -> AlignedRecording:
    """The recording NAME.csv (with NAME.yaml beside it), aligned with the model of its machine.

    machine : the machine's configuration; None takes the one that comes with compd under the name in the sidecar.
    Raises RecordingError with every problem of the recording, its sidecar and the machine's name together.
    """
    return align_recording(*read_with_machine(path, machine))


def open_model(path: Path | None, aligned: AlignedRecording) -> ModelFile:
    """The model file of the recording's machine; where None is named, a model without effects. Raises StateError."""
    machine = aligned.recording.machine
    return ModelFile(machine) if path is None else read_model_file(path, machine, aligned.rows.links)


def read_with_machine(
    path: Path, machine: Path | None = None, needs_reference: bool = True
) -> tuple[Recording, Configuration | None]:
    """The recording and the configuration of its machine, which is None for an external model.

    machine : as in `open_recording`.  needs_reference : False accepts a recording without a reference.
    Raises RecordingError as `open_recording` does, CompdError where the file `machine` cannot be used.
    """
    problems: list[Problem] = []
    configuration = _shipped(path.with_suffix(".yaml"), problems) if machine is None else load(machine)
    try:
        recording = read_recording(path, configuration, needs_reference)
    except RecordingError as error:
        raise RecordingError([*problems, *error.problems]) from error
    if problems:
        raise RecordingError(problems)
    return recording, configuration


def _shipped(sidecar_path: Path, problems: list[Problem]) -> Configuration | None:
    """The configuration that comes with compd for the machine that the sidecar names."""
    reported_by_the_reader: list[Problem] = []
    sidecar = read_sidecar(sidecar_path, reported_by_the_reader)
    if sidecar is None or sidecar.machine in ("", EXTERNAL):
        return None
    # a name, not a path: `..` or `/` would leave the place where configurations are
    name = sidecar.machine if re.fullmatch(r"[\w-]+", sidecar.machine) else "-"
    try:
        shipped = shipped_configuration(f"{name}.yaml")
    except CompdError:
        problems.append(
            Problem(
                where=str(sidecar_path),
                what="no configuration of this machine comes with compd",
                value=repr(sidecar.machine),
                next_step="give it with --machine PATH, or mend `machine:` in the sidecar",
            )
        )
        return None
    return load(shipped)
