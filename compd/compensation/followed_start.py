"""Where the first cycle's Newton starts: at the pose of its scales or of its target, followed from machine zero.

Far from machine zero, Newton alone would find another assembly of the machine, or none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compd.arrays import FloatArray
from compd.compensation.values import GaugeValues, WarmStart
from compd.model import MachineModel, observe
from compd.model.external import ExternalModel
from compd.model.kernels import Reason
from compd.model.kinematics import Movement


def followed_to_target(model: MachineModel, tip_mm: FloatArray) -> WarmStart:
    """At commanded tips (N, 3), in {B0}, with the attitude as at machine zero; where there is no such pose there."""
    start = WarmStart.at_zero(model)
    if model.attitude_is_free and model.extends_each:  # its lengths follow from the target at once
        return start
    tip_M_mm = model.arrangement.target_contact(model.frame, tip_mm).tip_M_mm
    pose, scale_mm = model.reach(np.broadcast_to(tip_M_mm, tip_mm.shape))
    known = pose.reason == Reason.OK
    return start._replace(
        supports_M_mm=np.broadcast_to(start.supports_M_mm, (len(known), 3, 3)),
        origin_M_mm=np.where(known[:, None], pose.origin_M_mm, start.origin_M_mm),
        rotation_M_P=np.where(known[:, None, None], pose.rotation_M_P, start.rotation_M_P),
        actuator_mm=model.zero.actuator_mm + np.where(known[:, None], scale_mm, 0.0),
    )


def first_start(
    model: MachineModel, warm: WarmStart, values: GaugeValues, target_mm: Sequence[float] | None
) -> WarmStart:
    """A warm start that is still at machine zero, moved to the pose of one snapshot as drawn; any other, and that
    of an external model, as it is.

    target_mm : the commanded tip in {B0}; None in CMM mode, where the scales give the pose.
    """
    zero = model.zero
    # of bytes, which takes a tenth of the time of np.array_equal in every cycle
    if isinstance(model, ExternalModel) or warm.origin_M_mm.tobytes() != zero.platform_origin_M_mm.tobytes():
        return warm
    if target_mm is not None:
        wanted_mm = np.where(model.actuators.fixed.astype(bool)[:3], target_mm, 0.0)
        ahead = followed_to_target(model, wanted_mm[None])
        origin_M_mm, rotation_M_P, actuator_mm = ahead.origin_M_mm, ahead.rotation_M_P, ahead.actuator_mm
    else:
        assert model.constants is not None
        scale_mm, joint_mm = values.scale_mm[None], values.joint_mm[None]
        rows = observe(
            model,
            model.constants,
            scale_mm=scale_mm,
            joint_mm=joint_mm,
            frame_mm=values.frame_mm[None],
            quantities={},
            time_s=np.zeros(1),
            session_start=np.ones(1, dtype=bool),
            movement=Movement.unknown(scale_mm, joint_mm),
        )
        origin_M_mm, rotation_M_P, actuator_mm = rows.origin_M_mm, rows.rotation_M_P, zero.actuator_mm + scale_mm
    if not np.isfinite(origin_M_mm).all():
        return warm
    return warm._replace(
        origin_M_mm=origin_M_mm.reshape(3),
        rotation_M_P=rotation_M_P.reshape(3, 3),
        actuator_mm=None if actuator_mm is None else actuator_mm.reshape(-1),
    )
