"""Calibration of a machine from its drawing and recordings of poses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from compd.api.arguments import Recorded, opened_recording
from compd.api.measurements import Range
from compd.built_machine import BuiltFiles, Provenance
from compd.built_machine import write_built_machine as write_built_files
from compd.calibration import Calibration, CalibrationPlan, Noise, PoseStudy, reachable_box
from compd.calibration import calibrate as calibrate_aligned
from compd.comparison import AlignedRecording
from compd.configuration import Machine, load_machine
from compd.errors import CompdError
from compd.machine_builder import build_model


def calibrate(
    recordings: Recorded | Sequence[Recorded],
    sealed: Recorded | Sequence[Recorded] = (),
    *,
    blocks: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
) -> Calibration:
    """Learn how a machine is built, from its drawing and recordings of poses at rest.

    Joints, lengths, zeros, gains, directions and the tip, as far as the machine has them, are fitted together, each
    with the machine's tolerance as prior. A block of them is taken where poses that were left out, at random and whole
    regions, are predicted better with it.

    Parameters
    ----------
    recordings : AlignedRecording, str, Path or sequence of these
        What to learn from, as `open_recording` returns it, or paths of recordings whose machine comes with compd. Each
        has its own instrument, frame and noise; all are of one machine.
    sealed : AlignedRecording, str, Path or sequence of these
        Recordings that are looked at last, for a test of the result.
    blocks : sequence of str
        Ids of the effects whose numbers may be taken, such as ``"link_zero"``; left out, all of the drawing.
    progress : callable, optional
        Called with a text as each step begins.

    Returns
    -------
    Calibration
        Each number with its drawing, value and standard error; errors of poses left out; what the poses cannot tell.

    Raises
    ------
    CompdError
        Where the recordings are of different machines or of an external model, or hold too few poses.
    RecordingError, ConfigurationError
        As `open_recording` does.

    Examples
    --------
    >>> import compd
    >>> hidden = ["base_joint_position"]
    >>> files = compd.simulate_campaign(
    ...     "hexapod", "built.csv", seed=3, plan="poses.csv", reference="pose", effects=hidden
    ... )
    >>> calibration = compd.calibrate("built.csv")
    >>> random = calibration.held_out[0]  # poses that were left out; rms per coordinate, um
    >>> print(f"{random.before_rms_um:.1f} -> {random.after_rms_um:.1f}")
    0.5 -> 0.2
    """
    return calibrate_aligned(_opened(recordings), _opened(sealed), progress, blocks)


def write_built_machine(
    calibration: Calibration,
    recordings: AlignedRecording | Sequence[AlignedRecording],
    out: str | Path,
    machine: Machine | None = None,
) -> BuiltFiles:
    """Write the machine as built: the configuration of the drawing with the numbers that a calibration has found.

    Comments stay, each number that changes has the drawing's beside it, and the head says what it was learned from.

    Parameters
    ----------
    calibration : Calibration
        What `calibrate` returned.
    recordings : AlignedRecording or sequence of these
        What it was learned from.
    out : str or Path
        The configuration to write, NAME.yaml. What no drawing states, such as gains of scales, goes into the model file
        NAME-model.yaml, which the configuration names.
    machine : str, Path or Configuration, optional
        The drawing, as `load_machine` takes it; left out, the one of the recordings.

    Returns
    -------
    BuiltFiles
        The files, and the numbers that differ from the drawing's.

    Raises
    ------
    ConfigurationError
        Where `out` is the drawing's own file, or that file states its numbers so that they cannot be replaced.

    Examples
    --------
    >>> import compd
    >>> recording = compd.open_recording("built.csv")
    >>> calibration = compd.calibrate(recording)
    >>> files = compd.write_built_machine(calibration, recording, "as-built.yaml")
    >>> print(files.machine)
    as-built.yaml
    """
    learned = [recordings] if isinstance(recordings, AlignedRecording) else list(recordings)
    recorded = learned[0].recording
    drawing = load_machine(machine or recorded.sidecar.machine_file or recorded.machine)
    provenance = Provenance(
        "compd calibrate",
        datetime.now(UTC).isoformat(timespec="seconds"),
        tuple((one.recording.path.name, one.recording.sha256) for one in learned),
    )
    covariance = calibration.fitted_covariance
    return write_built_files(drawing, calibration.fitted, covariance, provenance, Path(out))


def plan_calibration(
    machine: Machine,
    poses: int,
    noise_um: float,
    *,
    noise_urad: float | None = None,
    workspace_M_mm: tuple[Range, Range, Range] | None = None,
    measured: Sequence[AlignedRecording] = (),
) -> CalibrationPlan:
    """Plan the poses that tell most of how a machine is built: reachable, and away from its singularities.

    Parameters
    ----------
    machine : str, Path or Configuration
        The machine as `load_machine` takes it, with its drawing and, under ``geometry: tolerance_mm``, how well it is
        made.
    poses : int
        How many may be measured.
    noise_um : float
        Standard deviation of the instrument, um of each coordinate of the tip.
    noise_urad : float, optional
        Of its attitudes, urad, for an instrument that measures whole poses; left out, it measures positions.
    workspace_M_mm : three pairs of float, optional
        Lowest and highest x, y and z of the tip in {M}, mm; left out, six tenths of what the machine reaches.
    measured : sequence of AlignedRecording
        Recordings of poses that were measured before, in the same frame of the same instrument.

    Returns
    -------
    CalibrationPlan
        The poses, the indices of observability, and the standard error of the tip after the calibration.

    Raises
    ------
    CompdError
        For `machine: external`, a tool on the plate, or limits in which no pose is reached.
    ConfigurationError
        As `load_machine` does.

    Notes
    -----
    D-optimality by exchange: T. J. Mitchell, Technometrics 16 (1974) 203.

    Examples
    --------
    >>> import compd
    >>> plan = compd.plan_calibration("hexapod", 30, noise_um=0.15, noise_urad=2.0)
    >>> plan.write("poses.csv")
    """
    configuration = load_machine(machine)
    if configuration.external is not None:
        raise CompdError.of(
            configuration.where("machine"),
            "has no drawing of which poses could tell anything",
            value=configuration.machine,
            allowed="a machine with `geometry:`",
        )
    model = build_model(configuration.geometry, configuration.wiring)
    stroke_mm = configuration.geometry.link_length_mm
    box = reachable_box(model, stroke_mm)
    if workspace_M_mm is not None:
        low, high = np.array(workspace_M_mm, dtype=np.float64).T
        box = box._replace(low=np.concatenate([low, box.low[3:]]), high=np.concatenate([high, box.high[3:]]))
    noise = Noise(noise_um) if noise_urad is None else Noise(noise_um, noise_urad)
    before = [one.rows.select(np.flatnonzero(one.usable.mask)) for one in measured]
    study = PoseStudy(
        model,
        "position" if noise_urad is None else "pose",
        noise,
        stroke_mm,
        box,
        before=before[0].extended_by(*before[1:]) if before else None,
    )
    return study.plan(poses)


def _opened(recordings: Recorded | Sequence[Recorded]) -> list[AlignedRecording]:
    if isinstance(recordings, Sequence) and not isinstance(recordings, str):
        return [opened_recording(one) for one in recordings]
    return [opened_recording(recordings)]
