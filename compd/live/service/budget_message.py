"""The BUDGET message: where the newest setpoint has the moving platform, and how far each cause has moved the tip.

A SETPOINT has its contributions link by link, which is what the loop computes with. Here they are carried to the tip,
to first order, with the derivatives of the tip by the lengths of the links, and so is what the shadow model asks for.
It is computed when a client asks, in the process that serves clients: the loop has nothing to do with it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.live.service.message_keys.budget import BudgetKeys
from compd.model import MachineModel, tip_by_scales
from compd.model.external import ExternalModel
from compd.model.kernels import Reason
from compd.model.kinematics import Pose, forward_kinematics
from compd.rotation import compose, rotation_matrix, rotation_vector, to_inner, to_outer
from compd.setpoint_states import Mode
from compd.units import UM_PER_MM

# 0.1 nm, as uncertainties in a SETPOINT.
_DECIMALS_UM = 4
_DECIMALS_MM = 7
_DECIMALS_RAD = 10


class BudgetMessage:
    """Makes the BUDGET message of one machine; on the publisher's thread."""

    def __init__(self, machine: MachineModel, newest: Callable[[], bytes | None]) -> None:
        """`newest`: the SETPOINT line of the last cycle; None before the first."""
        self._machine = machine
        self._newest = newest
        if isinstance(machine, ExternalModel):
            return
        frame = machine.frame
        self._supports_B_mm = to_inner(frame.zero_rotation_M_B, frame.zero_origin_M_mm, frame.zero_supports_M_mm)
        self._base_joints_B_mm = self._supports_B_mm[frame.support_of_joint] + frame.joint_offsets_B_mm

    def message(self) -> dict[str, Any]:
        """The message as plain data; what the setpoint does not have is left out."""
        line = self._newest()
        if line is None:
            return BudgetKeys.message(valid=False, reason="there is no setpoint yet")
        setpoint = json.loads(line)
        head = {key: setpoint[key] for key in ("seq", "time_s", "valid", "state", "reason")}
        return BudgetKeys.message(**head, **(self._values(setpoint) if setpoint["valid"] else {}))

    def _pose_values(self, setpoint: Mapping[str, Any]) -> dict[str, Any]:
        """Where the pose is corrected: the sources are those of the tip."""
        values = {"tip_um": {cause: _um(-np.array(mm)) for cause, mm in setpoint["sources_mm"].items()}}
        shadow_M_mm = setpoint.get("shadow", {}).get("tip_M_mm")
        if shadow_M_mm is not None and setpoint["mode"] == Mode.CMM:
            uncorrected = np.array(setpoint["tip_M_mm"]) + setpoint["tip_correction_mm"]
            values["shadow_tip_um"] = _um(np.array(shadow_M_mm) - uncorrected)
        return values

    def _values(self, setpoint: Mapping[str, Any]) -> dict[str, Any]:
        if "tip_correction_mm" in setpoint:
            return self._pose_values(setpoint)
        scale_mm = _scale_mm(setpoint)
        supports, rotation_M_B, base_joints, pose = self._pose(setpoint, scale_mm)
        if pose.reason[0] != Reason.OK:
            return {}
        tip_M_mm = np.array([setpoint["tip_M_mm"]])
        by_scale = tip_by_scales(self._machine, rotation_M_B, base_joints, pose, tip_M_mm, scale_mm)[0]
        contributions_um = {
            cause: _um(-by_scale @ np.array(scales_mm)) for cause, scales_mm in setpoint["sources_mm"].items()
        }
        asked_mm = setpoint.get("shadow", {}).get("correction_mm")
        shadow = {} if asked_mm is None else {"shadow_tip_um": _um(-by_scale @ np.array(asked_mm))}
        return {
            "tip_um": contributions_um,
            **shadow,
            "supports_M_mm": supports.round(_DECIMALS_MM).tolist(),
            "supports_moved_um": _um(supports - self._machine.frame.zero_supports_M_mm),
            "base_joints_M_mm": base_joints[0].round(_DECIMALS_MM).tolist(),
            "platform": {
                "origin_M_mm": pose.origin_M_mm[0].round(_DECIMALS_MM).tolist(),
                "rotation_M_rad": rotation_vector(pose.rotation_M_P[0]).round(_DECIMALS_RAD).tolist(),
                "joints_M_mm": to_outer(pose.rotation_M_P[0], pose.origin_M_mm[0], self._machine.platform_joints_P_mm)
                .round(_DECIMALS_MM)
                .tolist(),
            },
        }

    def _pose(
        self, setpoint: Mapping[str, Any], scale_mm: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, Pose]:
        """Supports (3, 3) in {M}, the base's axes, and base joints (1, n, 3), carried along by the base platform as a
        whole; the moving platform."""
        frame = setpoint["frame"]
        rotation = compose(rotation_matrix(np.array(frame["rotation_M_rad"])), self._machine.frame.zero_rotation_M_B)
        origin_M_mm = np.array(frame["origin_M_mm"])
        supports = to_outer(rotation, origin_M_mm, self._supports_B_mm)
        base_joints = to_outer(rotation, origin_M_mm, self._base_joints_B_mm)[None]
        zero = self._machine.zero
        mechanism, _ = self._machine.links_on(rotation, base_joints, scale_mm)
        lengths = np.array([setpoint["link_length_mm"]])
        pose = forward_kinematics(mechanism, lengths, zero.platform_origin_M_mm, zero.rotation_M_P)
        return supports, rotation, mechanism.base_joints_M_mm, pose


def _scale_mm(setpoint: Mapping[str, Any]) -> FloatArray:
    """(1, m) where the scales are at the setpoint's pose: as they show in CMM mode, else as they are to show."""
    wanted, correction = np.array(setpoint["scale_setpoint_mm"]), np.array(setpoint["correction_mm"])
    return np.asarray((wanted - correction if setpoint["mode"] == "cmm" else wanted)[None])


def _um(lengths_mm: FloatArray) -> Any:
    """As rounded lists in um."""
    return (UM_PER_MM * lengths_mm).round(_DECIMALS_UM).tolist()
