"""Aligning a recording with its machine: what the model predicts from the gauges, and the reference in its frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.alignment.external_machine import external_observations
from compd.comparison.alignment.fixed_ends import place_balls, place_pins
from compd.comparison.alignment.measured_attitude import attitude_mm, measured_attitude, target_turn
from compd.comparison.alignment.registration import Registration, register
from compd.comparison.alignment.target_place import HELD, PlacedTarget, place_target, target_M_mm
from compd.comparison.alignment.velocity import velocities
from compd.comparison.criteria import ComparisonCriteria, SpeedCriteria
from compd.compensation import scales_of_command
from compd.configuration import Configuration
from compd.display_unit import ATTITUDE_LABELS
from compd.errors import CompdError, RecordingError
from compd.machine_builder import build_model
from compd.model import MachineModel, Prediction, observe
from compd.model.effects import Observations
from compd.model.kinematics import Movement
from compd.recording import Recording
from compd.travel_direction import row_directions


def align_recording(
    recording: Recording,
    configuration: Configuration | None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    held: frozenset[str] = frozenset(),
) -> AlignedRecording:
    """A recording on the machine that the configuration describes; None only for an external model.

    Raises RecordingError where there is no reference, or where nothing can be computed from any row.
    """
    model = None if configuration is None else build_model(configuration.geometry, configuration.wiring)
    geometry_hash = "" if configuration is None else configuration.geometry_hash
    return align_observations(
        recording, model, recorded_observations(recording, model, criteria), geometry_hash, criteria, held=held
    )


def align_sample(
    recording: Recording,
    configuration: Configuration | None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    held: frozenset[str] = frozenset(),
) -> AlignedRecording:
    """As `align_recording`, of the rows that were drawn; each is observed between its neighbours.

    recording : of `read_sample`.
    """
    sample = recording.sample
    assert sample is not None
    model = None if configuration is None else build_model(configuration.geometry, configuration.wiring)
    geometry_hash = "" if configuration is None else configuration.geometry_hash
    drawn = np.flatnonzero(np.isin(recording.row, sample.row))
    rows = recorded_observations(recording, model, criteria).select(drawn)
    recording = recording.select(drawn)
    if len(sample.row) == sample.rows:
        recording = replace(recording, sample=None)
    rows = replace(rows, session_start=session_starts(recording))
    return align_observations(recording, model, rows, geometry_hash, criteria, held=held)


def recorded_observations(
    recording: Recording, model: MachineModel | None, criteria: ComparisonCriteria = ComparisonCriteria()
) -> Observations:
    """Every row of the recording, as effects take it.  model : None for an external one.

    Raises RecordingError as `align_recording` does.
    """
    if recording.reference is None:
        where = str(recording.path)
        raise RecordingError.of(where, "names no reference", next_step="add one with `compd recording join`")
    starts = session_starts(recording)
    if model is None:
        return external_observations(recording, starts, criteria.speeds)
    return _observations(recording, model, starts, criteria.speeds)


def align_observations(
    recording: Recording,
    model: MachineModel | None,
    observations: Observations,
    geometry_hash: str = "",
    criteria: ComparisonCriteria = ComparisonCriteria(),
    held: frozenset[str] = frozenset(),
) -> AlignedRecording:
    """As `align_recording`, for rows that are observed already.

    held : numbers of the registration that are not fitted along; see `HELD`. Raises CompdError for one that this
        recording does not fit in any case.
    """
    assert recording.reference is not None
    if recording.target_P_mm is not None and (model is None or model.arrangement.on_plate):
        raise RecordingError.of(
            f"{recording.sidecar.path} reference.reflectors",
            "are on the platform of a machine that carries its tool, and this recording's is none",
            allowed="machines of which the platform carries the tool",
            next_step="make a recording of each reflector by itself",
        )
    if held:
        _check_held(recording, model, held)
    if recording.reference_link_mm is not None:
        labels = tuple(f"link {i}" for i in recording.reference_links)
        links = tuple(i - 1 for i in recording.reference_links)
        return AlignedRecording(
            recording,
            model,
            observations,
            labels,
            links,
            recording.reference_link_mm,
            None,
            geometry_hash,
            criteria=criteria,
        )
    if (end := recording.fixed_end) is not None:
        return _at_fixed_ends(
            AlignedRecording(
                recording,
                model,
                observations,
                ("x", "y", "z"),
                (0, 1, 2),
                np.full((recording.rows, 3), np.nan),
                None,
                geometry_hash,
                criteria=criteria,
            ),
            end,
        )
    measured_mm = recording.reference_mm
    if measured_mm is None:
        raise RecordingError.of(str(recording.path), "has no column of the reference")
    axes = tuple("xyz".index(axis) for axis in recording.reference_axes)
    registration: Registration | None = None
    target: PlacedTarget | None = None
    rotation_rad, nominal = recording.reference_rotation_rad, observations.rotation_M_P
    if recording.reference.frame == "instrument" and rotation_rad is not None and model is not None:
        target = _placed(recording, rotation_rad, observations, axes, criteria, held)
    if target is not None and rotation_rad is not None:
        registration = target.registration
        turn = target_turn(rotation_rad, nominal, registration)
        measured_mm = target.tip_M_mm(measured_mm, measured_attitude(rotation_rad, registration, turn))
    elif recording.reference.frame == "instrument":
        seen_M_mm = target_M_mm(observations.tip_M_mm, nominal, recording.target_P_mm)
        registration, measured_mm = _registered(recording, measured_mm, seen_M_mm, axes, criteria)
    labels = recording.reference_axes
    # beside a declared noise of the position nothing says what a urad counts: the attitude is compared, and fits no
    # effect; where no noise is declared, each counts by the size of its own residual
    reference = recording.reference
    weighed = model is not None and len(axes) == 3
    declared = np.isfinite(reference.standard_uncertainty).any()
    weighed &= bool(np.isfinite(reference.sigma_urad)) or not declared
    if weighed and rotation_rad is not None:
        turn = target_turn(rotation_rad, nominal, registration)
        attitude = measured_attitude(rotation_rad, registration, turn)
        measured_mm = np.concatenate([measured_mm, attitude_mm(attitude, nominal)], axis=1)
        labels = (*labels, *ATTITUDE_LABELS)
    return AlignedRecording(
        recording,
        model,
        observations,
        labels,
        axes,
        measured_mm,
        registration,
        geometry_hash,
        criteria=criteria,
        target=target,
        held=held,
    )


def aligned_with(
    aligned: AlignedRecording, prediction: Prediction, left_out: BoolArray | None = None
) -> AlignedRecording:
    """The recording registered again, to a prediction of its rows with effects in place of that without any.

    An instrument's frame and its target's place are then as right as the prediction, and what is fitted along is small.
    Fixed balls and pins, links and what was measured in {M} stay as they are.
    left_out : (N,) rows that place nothing.
    """
    if aligned.registration is None or aligned.ends is not None or aligned.model is None:
        return aligned
    rows = replace(aligned.rows, tip_M_mm=prediction.tip_mm, rotation_M_P=prediction.rotation_M_P)
    recording = aligned.recording
    placing = recording if left_out is None else replace(recording, excluded=recording.excluded | left_out)
    again = align_observations(placing, aligned.model, rows, aligned.geometry_hash, aligned.criteria, held=aligned.held)
    return replace(again, recording=recording, ranges=aligned.ranges)


def _check_held(recording: Recording, model: MachineModel | None, held: frozenset[str]) -> None:
    """Raise CompdError for a held number that is not fitted along."""
    assert recording.reference is not None
    instrument = recording.reference.frame == "instrument" and recording.reference_link_mm is None
    attitude = recording.reference_rotation_rad is not None and model is not None
    fitted = HELD["frame"] if instrument else frozenset[str]()
    fitted |= HELD["target.place"] if instrument and attitude else frozenset()
    fitted |= HELD["target.attitude"] if attitude else frozenset()
    if idle := held - fitted:
        raise CompdError.of(
            str(recording.path),
            "has nothing of a registration that these numbers are of: holding them changes nothing",
            value=", ".join(sorted(idle)),
            allowed=", ".join(sorted(fitted)) or "none: the reference is in the machine's frame, without attitudes",
            next_step="leave them out of what is held",
        )


def _at_fixed_ends(aligned: AlignedRecording, end: IntArray) -> AlignedRecording:
    """The recording with the fixed balls or pins found, and what was measured from them. end : (N,)."""
    recording, where = aligned.recording, str(aligned.recording.path)
    assert recording.reference is not None
    distance_mm = recording.reference_distance_mm
    tip_mm = np.where(recording.unused[:, None], np.nan, aligned.nominal_tip_mm)
    if distance_mm is None:
        ends = place_pins(tip_mm, end, recording.end_name, where)
    else:
        ends = place_balls(
            tip_mm, distance_mm, end, recording.reference.absolute, recording.end_name, where, aligned.criteria
        )
    if distance_mm is None:
        return replace(aligned, ends=ends, measured_mm=ends.place_of_row_mm)
    measured_mm = np.where(ends.of_row >= 0, distance_mm + ends.added_mm[ends.of_row], np.nan)[:, None]
    return replace(aligned, ends=ends, labels=("distance",), measured_mm=measured_mm)


def _placed(
    recording: Recording,
    rotation_rad: FloatArray,
    observations: Observations,
    axes: tuple[int, ...],
    criteria: ComparisonCriteria,
    held: frozenset[str],
) -> PlacedTarget | None:
    """Frame and target of an instrument that shows both place and attitude; None where the place is not shown."""
    if len(axes) < 3 or recording.reference_mm is None:
        return None
    points_mm = np.where(recording.unused[:, None], np.nan, recording.reference_mm)
    return place_target(points_mm, rotation_rad, observations.tip_M_mm, observations.rotation_M_P, criteria, held)


def _registered(
    recording: Recording,
    measured_mm: FloatArray,
    tip_M_mm: FloatArray,
    axes: tuple[int, ...],
    criteria: ComparisonCriteria,
) -> tuple[Registration | None, FloatArray]:
    """How the instrument's frame lies in {M}, and what was measured (N, m), in {M}; None where nothing fixes it.

    Points in the plane z = 0 are turned in it. Along fewer axes, or of a point of which the third coordinate matters,
    no frame can be laid over another: it must lie near already.
    """
    in_plane = axes == (0, 1) and not np.isfinite(tip_M_mm[:, 2]).any()
    if len(axes) < 3 and not in_plane:
        return None, measured_mm
    points, predicted = _in_space(measured_mm, axes), _in_space(tip_M_mm[:, list(axes)], axes)
    registration = register(np.where(recording.unused[:, None], np.nan, points), predicted, criteria)
    if registration is not None:
        measured_mm = registration.into_M(points)[:, list(axes)]
    return registration, measured_mm


def _observations(
    recording: Recording, model: MachineModel, starts: BoolArray, criteria: SpeedCriteria
) -> Observations:
    """Every row of the recording, as effects take it; comparators that were not recorded count as unmoved.

    starts : (N,) rows without a history.
    """
    assert model.constants is not None
    count = recording.rows
    scale_mm = _scales_mm(recording, model)
    comparators = model.joint_weights.shape[1]
    joint_mm = np.zeros((count, comparators)) if recording.joint_mm is None else recording.joint_mm
    frame_mm = np.zeros((count, 0)) if recording.frame_mm is None else recording.frame_mm
    approach = row_directions(scale_mm, recording.session) if recording.approach is None else recording.approach
    approach = np.nan_to_num(approach)
    at_point = np.zeros(count, dtype=bool) if recording.point is None else recording.point >= 0
    if recording.has_time:
        velocity = velocities(recording.time_s, starts, at_point, scale_mm, joint_mm, criteria)
    else:
        velocity = np.full((count, scale_mm.shape[1] + comparators), np.nan)
        approach = approach if recording.approach_measured else np.zeros_like(scale_mm)
    movement = Movement(approach, *np.split(velocity, [scale_mm.shape[1]], axis=1))
    rows = observe(
        model,
        model.constants,
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=frame_mm,
        quantities=recording.quantities,
        time_s=recording.elapsed_s,
        session_start=starts,
        movement=movement,
        quantities_at_zero=recording.sidecar.quantities_at_zero,
    )
    if recording.has_time:
        return rows
    direction = () if recording.approach_measured else ("direction",)
    return replace(rows, lacking=frozenset({"time", "order", "motion", *direction}))


def _scales_mm(recording: Recording, model: MachineModel) -> FloatArray:
    """(N, m) as recorded, or as the controller drives the poses that it was told."""
    if recording.scale_mm is not None:
        return recording.scale_mm
    if recording.commanded_mm is not None:
        return scales_of_command(model, recording.commanded_mm, recording.commanded_rotation_rad)
    raise RecordingError.of(
        str(recording.path),
        "has neither scale columns nor a commanded pose",
        allowed="scale_1_mm ..., or commanded_x_mm ...",
        next_step="a machine's recording needs one of the two; `machine: external` needs none",
    )


def session_starts(recording: Recording) -> BoolArray:
    """(N,) rows without a history: the first of each session."""
    starts = np.zeros(recording.rows, dtype=bool)
    starts[:1] = True
    if recording.session is not None:
        starts[1:] = recording.session[1:] != recording.session[:-1]
    return starts


def _in_space(values_mm: FloatArray, axes: tuple[int, ...]) -> FloatArray:
    """(N, 3) coordinates along `axes` (N, m), the others 0."""
    points = np.zeros((len(values_mm), 3))
    points[:, list(axes)] = values_mm
    return points
