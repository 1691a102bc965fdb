"""What the effects make of the tip: the real forward model with something added at its ports, and its derivatives."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.model.effect import Deltas, Effect, Port, port_size, split_by_port, sum_deltas
from compd.model.frame import Frame, solve_frame
from compd.model.joint_correction import joint_shortening, link_length_mm
from compd.model.kernels.rotation import compose, rotation_matrix
from compd.model.kinematics import Mechanism, closure_at, forward_kinematics
from compd.model.machine import MachineModel
from compd.model.observations import Observations
from compd.model.tool import ToolOnPlate
from compd.model.transform import to_inner, to_outer

# For derivatives of the frame: its curvature is 1 / 1 m, so that second differences vanish and rounding, 1e-13 mm,
# stays below 1e-9.
DIFFERENCE_STEP_MM = 1e-3


class Prediction(NamedTuple):
    """What a perfect reference, or with deltas at `reference` a real one, shows.

    tip_mm : (N, 3), the tip in {M}; with the tool on the plate the place on the work that it touches, in {P}.
    rotation_M_P : (N, 3, 3).  link_length_mm : (N, n).
    reason : (N,), a Reason; where it is not OK everything else is nan.
    """

    tip_mm: FloatArray
    rotation_M_P: FloatArray
    link_length_mm: FloatArray
    reason: IntArray


class Sensitivity(NamedTuple):
    """How a prediction changes with what is added at one port of `size` numbers.

    tip : (N, 3, size), mm per mm (or per rad at the port `revolute_axis`).
    rotation : (N, 3, size), rad per mm, about {M}'s axes.
    link_length : (N, n, size).
    """

    tip: FloatArray
    rotation: FloatArray
    link_length: FloatArray


class PerturbedMachine(NamedTuple):
    """The machine with something added at its ports, before any link length is known.

    frame : by equation (3).  mechanism : with the base joints as they are now.
    tool_mm : (..., 3), in {P}; of a tool that stands on the plate, in {M}.
    joint_shortening_mm : (..., n), gB + gS of equation (1).
    reading_to_length_mm : (..., n), what the ports `scale` and `link` add between a scale's reading and its link.
    reason : (...), a Reason, of the frame and the joint comparators.
    """

    frame: Frame
    mechanism: Mechanism
    tool_mm: FloatArray
    joint_shortening_mm: FloatArray
    reading_to_length_mm: FloatArray | float
    reason: IntArray


def perturb_machine(
    model: MachineModel, joint_mm: FloatArray, frame_mm: FloatArray, deltas: Deltas, unaltered: Frame | None = None
) -> PerturbedMachine:
    """The machine as the gauges and `deltas` have it; forward and inverse kinematics both start here.

    joint_mm (..., k), frame_mm (..., 9): changes since machine zero.  deltas : (..., size) per port, in mm (rad for
    directions); a port left out gets nothing.  unaltered : the frame without deltas, where it has been solved already.
    """
    frame = unaltered
    if frame is None or "frame" in deltas or "plate" in deltas:
        geometry = model.frame._replace(plate_points_M_mm=_points(model.frame.plate_points_M_mm, "plate", deltas))
        distances_mm = model.zero.distances_mm + _added(frame_mm, "frame", deltas)
        frame = solve_frame(geometry, distances_mm, None if unaltered is None else unaltered.supports_M_mm)
    shortening_mm, reason = joint_shortening(model.joint_weights, _added(joint_mm, "joint", deltas))
    mechanism = Mechanism(
        _points(frame.base_joints_M_mm, "base_joint", deltas),
        _points(model.platform_joints_P_mm, "platform_joint", deltas),
        _points(model.revolute_axes_P, "revolute_axis", deltas),
    )
    tool = model.arrangement
    tool_mm = _added(tool.tool_M_mm if isinstance(tool, ToolOnPlate) else tool.tool_P_mm, "tool", deltas)
    to_length_mm = deltas.get("scale", 0.0) + deltas.get("link", 0.0)
    return PerturbedMachine(frame, mechanism, tool_mm, shortening_mm, to_length_mm, np.maximum(reason, frame.reason))


def predict(model: MachineModel, rows: Observations, deltas: Deltas) -> Prediction:
    """Equations (1), (3) and forward kinematics with `deltas` added at the machine's ports.

    deltas : as in `altered`; and at the port `reference`, which no machine has.
    A row fails as `solve_frame` and `forward_kinematics` do.
    """
    machine = perturb_machine(model, rows.joint_mm, rows.frame_mm, deltas)
    length_mm = link_length_mm(model.zero.link_length_mm, rows.scale_mm, machine.joint_shortening_mm)
    pose = forward_kinematics(
        machine.mechanism, length_mm + machine.reading_to_length_mm, rows.origin_M_mm, rows.rotation_M_P
    )
    seen_from = to_inner if isinstance(model.arrangement, ToolOnPlate) else to_outer
    tip = seen_from(pose.rotation_M_P, pose.origin_M_mm, machine.tool_mm)
    rotation = pose.rotation_M_P
    if "reference" in deltas:
        tip = tip + deltas["reference"][:, :3]
        rotation = compose(rotation_matrix(deltas["reference"][:, 3:]), rotation)
    return Prediction(tip, rotation, pose.link_length_mm, np.maximum(machine.reason, pose.reason))


def sensitivities(model: MachineModel, rows: Observations, ports: Collection[Port]) -> dict[Port, Sensitivity]:
    """Derivatives of `predict` by what is added at each of `ports`, where nothing is added.

    From the closure's derivatives; for the ports `frame` and `plate` by central differences through the octahedron.
    Observations without a pose are nan.
    """
    inverse = _pose_by_closure(model, rows)
    tip_by_pose = _tip_by_pose(model, rows)
    found: dict[Port, Sensitivity] = {}
    for port in ports:
        size = port_size(port, rows)
        tip, rotation, link_length = (np.zeros((len(rows), m, size)) for m in (3, 3, rows.links))
        if port == "tool":
            on_plate = isinstance(model.arrangement, ToolOnPlate)
            tip[:] = rows.rotation_M_P.transpose(0, 2, 1) if on_plate else rows.rotation_M_P
        elif port == "reference":
            tip[:, :, :3] = rotation[:, :, 3:] = np.eye(3)
        else:
            pose = inverse @ _closure_by(model, rows, port)
            tip, rotation = tip_by_pose @ pose, pose[:, 3:]
        if port in ("scale", "link"):
            link_length[:] = np.eye(size)
        elif port == "joint":
            link_length[:] = -model.joint_weights
        found[port] = Sensitivity(tip, rotation, link_length)
    return found


def _pose_by_closure(model: MachineModel, rows: Observations) -> FloatArray:
    """(N, 6, 6): displacement and rotation of the platform by n link lengths and k offsets of revolute axes."""
    close = closure_at(model.mechanism(rows.base_joints_M_mm), rows.origin_M_mm, rows.rotation_M_P)
    lengths = np.concatenate([close.length_by_displacement, close.length_by_rotation_mm], axis=2)
    offsets = np.concatenate([close.offset_by_displacement, close.offset_by_rotation_mm], axis=2)
    J = np.concatenate([lengths, offsets], axis=1)
    good = np.isfinite(J).all(axis=(1, 2))
    inverse = np.full_like(J, np.nan)
    inverse[good] = np.linalg.inv(J[good])
    return inverse


def _tip_by_pose(model: MachineModel, rows: Observations) -> FloatArray:
    """(N, 3, 6): the tip by displacement and rotation of the platform; with the tool on the plate, as {P} sees it."""
    x, y, z = (rows.tip_M_mm - rows.origin_M_mm).T
    nought = np.zeros_like(x)
    by_rotation = np.stack([nought, z, -y, -z, nought, x, y, -x, nought], axis=1).reshape(-1, 3, 3)  # w x lever
    found = np.concatenate([np.broadcast_to(np.eye(3), by_rotation.shape), by_rotation], axis=2)
    if isinstance(model.arrangement, ToolOnPlate):
        return np.asarray(-rows.rotation_M_P.transpose(0, 2, 1) @ found)
    return found


def _closure_by(model: MachineModel, rows: Observations, port: Port) -> FloatArray:
    """(N, 6, size): what the closure is asked to make up for when something is added at `port`: link lengths first,
    then offsets of the revolute axes."""
    count, n, k = len(rows), rows.links, len(model.revolute_axes_P)
    if port in ("frame", "plate"):
        return np.asarray(_closure_by(model, rows, "base_joint") @ _base_joints_by(model, rows, port))
    if port in ("scale", "link", "joint"):
        found = np.zeros((count, 6, port_size(port, rows)))
        found[:, :n] = -model.joint_weights if port == "joint" else np.eye(n)
        return found
    each, axis = np.arange(n), np.arange(k)
    directions_P = rows.directions_M @ rows.rotation_M_P  # R^T u
    if port == "revolute_axis":
        turned = np.zeros((count, 6, k, 3))
        turned[:, n + axis, axis] = -directions_P[:, :k] * rows.link_mm[:, :k, None]
        return turned.reshape(count, 6, 3 * k)
    moved = np.zeros((count, 6, n, 3))
    if port == "base_joint":
        moved[:, each, each] = rows.directions_M
        moved[:, n + axis, axis] = rows.revolute_axes_M
    else:
        moved[:, each, each] = -directions_P
        moved[:, n + axis, axis] = -model.revolute_axes_P
    return moved.reshape(count, 6, 3 * n)


def effect_sensitivity(
    effect: Effect, rows: Observations, basis: FloatArray, by: Mapping[Port, Sensitivity]
) -> Sensitivity:
    """The prediction's derivatives by an effect's fitted numbers: (N, 3, P), (N, 3, P), (N, n, P).

    basis : (N, sum of port sizes, P), from `effect.basis`.  by : from `sensitivities`, for the effect's ports at least.
    """
    parts = [(by[port], values) for port, values in split_by_port(effect, rows, basis).items()]
    tip, rotation, link_length = (
        sum((sensitivity[i] @ values for sensitivity, values in parts), start=np.zeros(())) for i in range(3)
    )
    return Sensitivity(tip, rotation, link_length)


def link_residuals(link: Sensitivity, tip_residual_mm: FloatArray) -> FloatArray:
    """The link lengths' errors (N, n), in mm, that would explain residuals (N, 3) at the tip.

    link : the sensitivity of the port `link`. For a hexapod, whose attitude is free, the smallest such errors.
    Observations without a pose are nan.
    """
    good = np.asarray(np.isfinite(link.tip).all(axis=(1, 2)))
    found = np.full((len(good), link.tip.shape[2]), np.nan)
    found[good] = (np.linalg.pinv(link.tip[good]) @ tip_residual_mm[good, :, None])[:, :, 0]
    return found


def shares(model: MachineModel, rows: Observations, deltas: Mapping[str, Deltas]) -> dict[str, FloatArray]:
    """What each effect contributes to the prediction (N, 3), in mm: what it adds to those before it.

    deltas : by effect id, in the model's order.  The shares add up to the whole but for rounding.
    """
    found: dict[str, FloatArray] = {}
    names = list(deltas)
    before = predict(model, rows, {}).tip_mm
    for count, name in enumerate(names, start=1):
        after = predict(model, rows, sum_deltas([deltas[one] for one in names[:count]])).tip_mm
        found[name] = after - before
        before = after
    return found


def _added(value: FloatArray, port: Port, deltas: Deltas) -> FloatArray:
    return value + deltas[port] if port in deltas else value


def _points(points: FloatArray, port: Port, deltas: Deltas) -> FloatArray:
    """Points (..., m, 3) and their deltas (..., 3 m)."""
    return points + deltas[port].reshape(*deltas[port].shape[:-1], -1, 3) if port in deltas else points


def _base_joints_by(model: MachineModel, rows: Observations, port: Port) -> FloatArray:
    """Derivatives (N, 3 n, 9) of the base joints by the frame's distances or the plate's points."""
    distances_mm = model.zero.distances_mm + rows.frame_mm
    steps = DIFFERENCE_STEP_MM * np.concatenate([np.eye(9), -np.eye(9)])
    if port == "frame":
        frame = solve_frame(model.frame, distances_mm + steps[:, None])
    else:
        plates = model.frame.plate_points_M_mm + steps.reshape(18, 1, 3, 3)
        frame = solve_frame(model.frame._replace(plate_points_M_mm=plates), distances_mm)
    ends = frame.base_joints_M_mm.reshape(18, len(rows), -1)
    return np.asarray(np.moveaxis((ends[:9] - ends[9:]) / (2 * DIFFERENCE_STEP_MM), 0, 2))
