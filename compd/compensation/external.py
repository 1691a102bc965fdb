"""From the pose that own kinematics or a client gives to the corrected pose, and to what the scales are to show."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.compensation.values import Compensation, Contributions, GaugeValues, WarmStart
from compd.model import EffectMemory, deltas_by_effect, sum_deltas
from compd.model.external import ExternalModel, OwnPose, carried_to_pose, external_rows, moved_pose, scales_for
from compd.model.kernels import Reason
from compd.model.kinematics import Frame
from compd.rotation import rotation_matrix


def compensate_external(
    model: ExternalModel, values: GaugeValues, warm: WarmStart, commanded: bool = False
) -> tuple[Compensation, WarmStart]:
    """One snapshot. `target_B_mm` is the pose's own tip. In CMM mode the tip is where it is by the pose and what the
    effects add; commanded, it is the pose, which is reached with the correction.

    commanded : whether a client has given the pose.
    The reason is NOT_FINITE where an effect gives no number. Raises OwnKinematicsError where there is no pose.
    """
    memory, links = warm.effects, model.links
    quantities = {name: np.asarray(value, dtype=np.float64).reshape(1) for name, value in values.quantities.items()}
    time_s = np.array([values.time_s], dtype=np.float64)
    scale_mm = np.asarray(values.scale_mm)
    rows, poses, motion = external_rows(model, scale_mm[None], quantities, time_s, None, memory)
    pose = poses[0]
    deltas, memories = deltas_by_effect(model.live_effects, rows, memory.memories)
    by_cause_mm = np.zeros((2 + len(deltas), 3))
    for k, added in enumerate(deltas.values(), start=2):
        by_cause_mm[k] = -carried_to_pose(added, poses)[0, :3]
    total = sum_deltas(deltas.values()) if deltas else {}
    change = carried_to_pose(total, poses)[0] if total else np.zeros(6)
    tip_mm, rotation_rad = (pose.tip_M_mm, pose.rotation_M_rad) if commanded else moved_pose(pose, change)
    usable = bool(np.isfinite(tip_mm).all() and np.isfinite(by_cause_mm).all() and np.isfinite(scale_mm).all())
    correction_mm = scales_for(total, pose) if total and usable else np.zeros(links)
    compensation = Compensation(
        tip_M_mm=tip_mm,
        tip_B0_mm=tip_mm,
        tip_P_mm=np.full(3, np.nan),
        rotation_M_P=rotation_matrix(rotation_rad) if np.isfinite(rotation_rad).all() else np.full((3, 3), np.nan),
        frame=_standing_frame(links),
        link_length_mm=np.zeros(0),
        target_B_mm=pose.tip_M_mm,
        nominal_scale_mm=scale_mm,
        scale_setpoint_mm=scale_mm + correction_mm,
        correction_mm=correction_mm,
        contributions=Contributions(model.contribution_names, by_cause_mm),
        reason=np.array(int(Reason.OK if usable else Reason.NOT_FINITE)),
        rotation_M_rad=rotation_rad if np.isfinite(rotation_rad).all() else None,
        pose_correction=_undone(change, pose),
        own_columns={name: float(rows.quantities[name][0]) for name in model.columns} or None,
    )
    if model.live_effects:
        memory = EffectMemory(motion, {**memory.memories, **memories}, commanded)
    return compensation, warm._replace(effects=memory)


def external_as_applied(
    model: ExternalModel, wanted: Compensation, values: GaugeValues, warm: WarmStart, applied_mm: FloatArray
) -> Compensation:
    """The compensation with the tip that belongs to the correction (n,) which is applied, not to the one asked for: by
    the pose at the scales less the one and less the other; where a client has given the pose, by its derivatives."""
    if model.given is not None:
        missing_mm = model.given.by_scale[:3] @ (applied_mm - wanted.correction_mm)
        assert wanted.pose_correction is not None, "it has one of every machine with a pose of its own"
        return wanted._replace(pose_correction=wanted.pose_correction + np.append(missing_mm, np.zeros(3)))
    bare = model.without_effects()
    reached, asked = (
        compensate_external(bare, values._replace(scale_mm=values.scale_mm - correction_mm), warm)[0].tip_M_mm
        for correction_mm in (applied_mm, wanted.correction_mm)
    )
    tip_mm = wanted.tip_M_mm + reached - asked
    rotation = wanted.pose_correction[3:] if wanted.pose_correction is not None else np.full(3, np.nan)
    return wanted._replace(
        tip_M_mm=tip_mm, tip_B0_mm=tip_mm, pose_correction=np.append(wanted.target_B_mm - tip_mm, rotation)
    )


def _undone(change: FloatArray, pose: OwnPose) -> FloatArray:
    """(6,) what undoes a change of the pose, to first order; the rotation is nan where the pose has none."""
    correction = 0.0 - change
    if not np.isfinite(pose.rotation_M_rad).all():
        correction[3:] = np.nan
    return correction


def _standing_frame(links: int) -> Frame:
    """A frame of which nothing is measured: it stands still."""
    nowhere = np.zeros(3)
    return Frame(
        np.full((3, 3), np.nan),
        nowhere,
        np.eye(3),
        np.full((links, 3), np.nan),
        nowhere,
        nowhere,
        np.array(0),
        np.array(0.0),
        np.array(int(Reason.OK)),
    )
