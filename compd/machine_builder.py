"""From the configuration to the machine model: {B} coordinates into {M}, comparator roles into weights."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.configuration import (
    COORDINATES,
    Actuator,
    ExternalGeometry,
    Geometry,
    MechanismDescription,
    SlidingActuator,
    ToolOnPlateSettings,
    ToolOnPlatformSettings,
    TurningActuator,
    external_of,
)
from compd.errors import PluginError
from compd.model import MachineModel, MachineParts, machine_constants, machine_model
from compd.model.effects import MachineDetails
from compd.model.external import ExternalModel, Kinematics, new_external_model
from compd.model.kinematics import ACTUATOR_KINDS, Actuators, Arrangement, Contact, ToolOnPlate, ToolOnPlatform
from compd.operation_settings import Wiring
from compd.rotation import rotation_matrix, to_outer
from compd.units import UM_PER_MM

# Equation (1): the two ball shanks of a revolute joint are averaged, gB = (Ra + Rb) / 2.
WEIGHT_OF_ROLE: Mapping[str, float] = {"S": 1.0, "B": 1.0, "Ra": 0.5, "Rb": 0.5}


def build_model(geometry: Geometry, wiring: Wiring) -> MachineModel:
    """The machine that a configuration describes.

    Signs of gauges and machine zero's readings are the wiring's business: the model gets changes since machine zero,
    positive as in equations (1), (6) and (7).
    Raises KinematicsError where the machine zero that it describes is unreachable or near-singular; PluginError for own
    kinematics that cannot be used.
    """
    if (external := external_of(geometry)) is not None:
        return build_external(external, wiring)
    model = machine_model(machine_parts(geometry, wiring))
    return replace(
        model,
        constants=machine_constants(model, machine_details(geometry)),
        frame_drift_mm=wiring.unmeasured_frame_um / UM_PER_MM,
        quantity_noise={wire.name: wire.noise for wire in wiring.quantities if wire.noise is not None},
    )


def machine_parts(geometry: Geometry, wiring: Wiring) -> MachineParts:
    """The parts that the configuration describes, whether or not they make a machine."""
    base, mechanism = geometry.base, geometry.mechanism
    rotation_M_B = rotation_matrix(np.array(base.rotation_B0_in_M_rad))
    origin_M_mm = np.array(base.origin_B0_in_M_mm)
    attitude_rad = np.array(geometry.tool.zero_rotation_P_in_M_rad)
    tool, contact = _tool(geometry.tool)
    return MachineParts(
        supports_M_mm=to_outer(rotation_M_B, origin_M_mm, np.array(base.supports_B_mm or np.zeros((3, 3)))),
        plate_points_M_mm=geometry.plate_points_M_mm or np.full((3, 3), np.nan),
        rotation_M_B=rotation_M_B,
        base_joints_M_mm=to_outer(rotation_M_B, origin_M_mm, np.array([rod.base_B_mm for rod in mechanism.rods])),
        support_of_joint=np.array(base.support_of_joint or np.ones(geometry.links, dtype=np.int64)) - 1,
        platform_joints_P_mm=[rod.platform_P_mm for rod in mechanism.rods],
        revolute_axes_P=_hinge_axes(mechanism, rotation_M_B),
        hinges=_hinges(mechanism),
        actuators=_actuators(mechanism, rotation_M_B),
        actuator_guess_mm=[_guess_mm(actuator) for actuator in mechanism.actuators],
        arrangement=tool,
        zero_contact=contact,
        zero_rotation_M_P=None if geometry.kinematics == "tripod_3spr" else rotation_matrix(attitude_rad),
        joint_weights=joint_weights(wiring, geometry.links),
        weight_N=geometry.platform.weight_N,
        weight_at_P_mm=geometry.platform.weight_at_P_mm,
    )


def build_external(geometry: ExternalGeometry, wiring: Wiring) -> ExternalModel:
    """The model of `machine: external`. Raises PluginError where its class cannot be used."""
    own = own_kinematics(geometry)
    model = new_external_model(own, geometry.links, geometry.scale_signal_period_mm or math.nan)
    wired = [quantity.name for quantity in wiring.quantities]
    if missing := [name for name in model.settings if name not in wired]:
        raise PluginError.of(
            "geometry.kinematics",
            f"the class needs {', '.join(missing)}, which no gauge measures",
            value=geometry.kinematics,
            allowed=", ".join(wired) or "nothing is wired",
            next_step="wire it under `wiring: quantities:`, or take it out of `settings`",
        )
    return model


def own_kinematics(geometry: ExternalGeometry) -> Kinematics | None:
    """An object of the class that a configuration names, whose file is executed; None where a client gives the pose.

    Raises PluginError where the file's hash is another one, or it holds no such class.
    """
    if geometry.own_class is None:
        return None
    file, name = geometry.own_class
    where = "geometry.kinematics"
    kind = getattr(geometry.code.module(file, where, "class"), name, None)
    what = ""
    if not (isinstance(kind, type) and issubclass(kind, Kinematics)):
        what = "the file has no such subclass of `compd.Kinematics`"
    else:
        try:
            own = kind()
        except (Exception, SystemExit) as error:  # noqa: BLE001  a person's own code may raise anything
            what = f"the class cannot be made without arguments: {type(error).__name__}: {error}"
    if what:
        raise PluginError.of(where, what, value=f"{file}:{name}", next_step="mend the file or the name")
    return own


def _hinges(mechanism: MechanismDescription) -> IntArray:
    """(k, 2): the rod of each hinge, from 0, and whether the base carries it."""
    hinges = [[hinge.rod - 1, int(hinge.axis_B is not None)] for hinge in mechanism.hinges]
    return np.array(hinges, dtype=np.int64).reshape(-1, 2)


def _hinge_axes(mechanism: MechanismDescription, rotation_M_B: FloatArray) -> FloatArray:
    """(k, 3): in {P} of a hinge on the platform, in {M} of one on the base."""
    axes = [
        hinge.axis_P if hinge.axis_B is None else rotation_M_B @ np.array(hinge.axis_B) for hinge in mechanism.hinges
    ]
    return np.array(axes, dtype=np.float64).reshape(-1, 3)


def _actuators(mechanism: MechanismDescription, rotation_M_B: FloatArray) -> Actuators:
    """The actuators in {M}, as the kernels take them."""
    count = len(mechanism.actuators)
    cosine_B, sine_B, radius_mm = (
        np.tile([1.0, 0.0, 0.0], (count, 1)),
        np.tile([0.0, 1.0, 0.0], (count, 1)),
        np.ones(count),
    )
    for i, actuator in enumerate(mechanism.actuators):
        if isinstance(actuator, SlidingActuator):
            cosine_B[i] = actuator.along_B
        elif isinstance(actuator, TurningActuator):
            cosine_B[i], sine_B[i], radius_mm[i] = actuator.cosine_B, actuator.sine_B, actuator.radius_mm
    return Actuators(
        np.array([ACTUATOR_KINDS.index(actuator.kind) for actuator in mechanism.actuators]),
        cosine_B @ rotation_M_B.T,
        sine_B @ rotation_M_B.T,
        radius_mm,
        np.array([rod.actuator - 1 for rod in mechanism.rods]),
        np.array([rod.length_mm for rod in mechanism.rods]),
        np.array([int(name in mechanism.target_fixes) for name in COORDINATES]),
    )


def _guess_mm(actuator: Actuator) -> float:
    """About where an actuator stands at machine zero; an extended rod has any length above 0 there."""
    if isinstance(actuator, TurningActuator):
        return actuator.zero_rad * actuator.radius_mm
    return actuator.zero_mm if isinstance(actuator, SlidingActuator) else 1.0


def machine_details(geometry: Geometry) -> MachineDetails:
    """What effects need of a geometry beyond its kinematics; nan where it says nothing."""
    unknown = float("nan")
    return MachineDetails(
        geometry.plate_thickness_mm or unknown,
        geometry.scale_signal_period_mm or unknown,
        tolerance_mm=geometry.made_to_mm or unknown,
        link_limits_mm=geometry.link_length_mm or (unknown, unknown),
    )


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
