"""From the configuration to the machine model: {B} coordinates into {M}, comparator roles into weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Geometry, ToolOnPlateSettings, ToolOnPlatformSettings
from compd.model import MachineModel, MachineParts, machine_constants, machine_model
from compd.model.effects import MachineDetails
from compd.model.kinematics import Arrangement, Contact, ToolOnPlate, ToolOnPlatform
from compd.operation_settings import Wiring
from compd.rotation import rotation_matrix, to_outer

# Equation (1): the two ball shanks of a revolute joint are averaged, gB = (Ra + Rb) / 2.
WEIGHT_OF_ROLE: Mapping[str, float] = {"S": 1.0, "B": 1.0, "Ra": 0.5, "Rb": 0.5}


def build_model(geometry: Geometry, wiring: Wiring) -> MachineModel:
    """The machine that a configuration describes.

    Signs of gauges and machine zero's readings are the wiring's business: the model gets changes since machine zero,
    positive as in equations (1), (6) and (7).
    Raises KinematicsError where the machine zero that it describes is unreachable or near-singular.
    """
    base = geometry.base
    rotation_M_B = rotation_matrix(np.array(base.rotation_B0_in_M_rad))
    origin_M_mm = np.array(base.origin_B0_in_M_mm)
    attitude_rad = np.array(geometry.tool.zero_rotation_P_in_M_rad)
    tool, contact = _tool(geometry.tool)
    model = machine_model(
        MachineParts(
            supports_M_mm=to_outer(rotation_M_B, origin_M_mm, np.array(base.supports_B_mm)),
            plate_points_M_mm=geometry.plate_points_M_mm,
            base_joints_M_mm=to_outer(rotation_M_B, origin_M_mm, np.array(base.joints_B_mm)),
            support_of_joint=np.array(base.support_of_joint) - 1,
            platform_joints_P_mm=geometry.platform.joints_P_mm,
            revolute_axes_P=np.array(geometry.platform.revolute_axes_P).reshape(-1, 3),
            arrangement=tool,
            zero_contact=contact,
            zero_rotation_M_P=None if geometry.links == 3 else rotation_matrix(attitude_rad),
            joint_weights=joint_weights(wiring, geometry.links),
            weight_N=geometry.platform.weight_N,
            weight_at_P_mm=geometry.platform.weight_at_P_mm,
        )
    )
    return replace(model, constants=machine_constants(model, machine_details(geometry)))


def machine_details(geometry: Geometry) -> MachineDetails:
    """What effects need of a geometry beyond its kinematics; nan where it says nothing."""
    unknown = float("nan")
    return MachineDetails(geometry.plate_thickness_mm or unknown, geometry.scale_signal_period_mm or unknown)


def joint_weights(wiring: Wiring, links: int) -> FloatArray:
    """(n, k): what each joint comparator, in the wiring's order, counts for each link in equation (1)."""
    weights = np.zeros((links, len(wiring.joint)))
    for k, wire in enumerate(wiring.joint):
        weights[wire.link - 1, k] = WEIGHT_OF_ROLE[wire.role]
    return weights


def _tool(tool: ToolOnPlatformSettings | ToolOnPlateSettings) -> tuple[Arrangement, Contact]:
    """The arrangement, and its contact at machine zero."""
    if isinstance(tool, ToolOnPlatformSettings):
        tool_P_mm = np.array(tool.at_P_mm)
        return ToolOnPlatform(tool_P_mm), Contact(np.array(tool.zero_tip_M_mm), tool_P_mm)
    tool_M_mm = np.array(tool.at_M_mm)
    return ToolOnPlate(tool_M_mm), Contact(tool_M_mm, np.array(tool.zero_tip_P_mm))
