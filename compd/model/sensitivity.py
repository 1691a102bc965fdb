"""How the predicted tip changes with what is added at the machine's ports: the derivatives of `predict`.

The pose x = (displacement of {P} in mm, rotation about {M}'s axes in rad) satisfies the closure of the links,

    |d_i| = l_i  for each link i,   d_i . R e_i = 0  for each revolute axis i,   d_i = p + R c_i - a_i,

six equations f(x, q) = r with r = (l, 0), where q stands for whatever the ports change: base joints a_i, platform
joints c_i, revolute axes e_i. To first order a change of q or r moves the pose by

    dx = J^-1 (dr - f_q dq),   J = f_x   (6 x 6).

Below, `inverse` is J^-1 and `_closure_demand` the bracket per unit of what is added at a port. With u_i the unit vector
of link i, its entries for link i and axis i are

    link             1                         joint            minus the joint weights, equation (1)
    base_joint       u_i and R e_i             platform_joint   -R^T u_i and -e_i, in {P}
    revolute_axis    -R^T d_i, in {P}          frame, plate     those of what the base carries, base_joint and
                                                                revolute_axis, times d / d (distances or points)
    scale            1 of an extended link; those of base_joint times d a / d q where the actuator moves the joint

An axis that the base carries is e_i, in {M}, in place of R e_i.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.model.effects import Observations, Port, port_size
from compd.model.kinematics import ACTUATOR_KINDS, Frame, Mechanism, Pose, closure_at, solve_frame
from compd.model.machine import MachineModel

# Step of the central differences through the octahedron, whose sides are about 1 m: the difference's own error is of
# order (1e-3 / 1e3)^2 = 1e-12, and rounding of coordinates, 1e-13 mm, makes 1e-10 of it.
DIFFERENCE_STEP_MM = 1e-3


class Sensitivity(NamedTuple):
    """How a prediction changes with what is added at one port of `size` numbers, or with `size` fitted numbers.

    tip : (N, 3, size), mm per mm (or per rad at the port `revolute_axis`).
    rotation : (N, 3, size), rad per mm, about {M}'s axes.
    link_length : (N, n, size).
    """

    tip: FloatArray
    rotation: FloatArray
    link_length: FloatArray


def sensitivities(model: MachineModel, rows: Observations, ports: Collection[Port]) -> dict[Port, Sensitivity]:
    """Derivatives of `predict` by what is added at each of `ports`, where nothing is added.

    From the closure's derivatives (module docstring); for the ports `frame` and `plate` with central differences
    through the octahedron, chained with what the base carries. Rows without a pose are nan.

    Example: how much a micrometre on each scale moves the tip, (N, 3, n) in um:

        sensitivities(model, rows, ["scale"])["scale"].tip
    """
    inverse = _pose_by_closure(model.mechanism(rows.base_joints_M_mm), rows.origin_M_mm, rows.rotation_M_P)
    tip_by_pose = _tip_by_pose(model, rows.tip_M_mm - rows.origin_M_mm, rows.rotation_M_P)
    by_port: dict[Port, Sensitivity] = {}
    for port in ports:
        size = port_size(port, rows)
        tip, rotation, link_length = (np.zeros((len(rows), m, size)) for m in (3, 3, rows.links))
        if port == "tool":
            # p + R tool in {M}, or R^T (tool - p) in {P}
            tip[:] = rows.rotation_M_P.transpose(0, 2, 1) if model.arrangement.on_plate else rows.rotation_M_P
        elif port == "reference":
            tip[:, :, :3] = rotation[:, :, 3:] = np.eye(3)
        else:
            pose = inverse @ _closure_demand(model, rows, port)
            tip, rotation = tip_by_pose @ pose, pose[:, 3:]
        if port == "scale":
            link_length[:] = _extension(model)
        elif port == "link":
            link_length[:] = np.eye(size)
        elif port == "joint":
            link_length[:] = -model.joint_weights
        by_port[port] = Sensitivity(tip, rotation, link_length)
    return by_port


def tip_by_scales(
    model: MachineModel, mechanism: Mechanism, pose: Pose, tip_M_mm: FloatArray, scale_mm: FloatArray
) -> FloatArray:
    """Derivatives (N, 3, m), mm per mm, of the tip by the scales: how far one that shows more moves it.

    mechanism : base joints (N, n, 3) where the scales (N, m) have moved them.  pose : of N rows.  tip_M_mm : (N, 3),
    where the tool touches.
    With the tool on the plate the derivatives are those of the touched place in {P}. Rows without a pose are nan.
    """
    inverse = _pose_by_closure(mechanism, pose.origin_M_mm, pose.rotation_M_P)
    tip_by_pose = _tip_by_pose(model, tip_M_mm - pose.origin_M_mm, pose.rotation_M_P)
    demand = np.zeros((len(scale_mm), 6, model.scales))
    demand[:, : model.links] = _extension(model)
    if model.actuators.kinds.any():
        closure = closure_at(mechanism, pose.origin_M_mm, pose.rotation_M_P)
        along = np.concatenate([closure.length_by_displacement, closure.offset_by_displacement], axis=1)
        of_row = np.concatenate([np.arange(model.links), model.hinges[:, 0]])
        by_scale = _joints_by_scale(model, scale_mm).reshape(len(scale_mm), model.links, 3, model.scales)
        # a base joint that moves on shortens its link as much as the platform going back does
        demand += np.einsum("nrd,nrdm->nrm", along, by_scale[:, of_row])
    return np.asarray(tip_by_pose @ inverse @ demand)


def link_residuals(link: Sensitivity, tip_residual_mm: FloatArray) -> FloatArray:
    """The link lengths' errors (N, n), in mm, that would explain residuals (N, 3) at the tip.

    link : the sensitivity of the port `link`. For a hexapod, whose attitude is free, the smallest such errors
    (pseudoinverse). Rows without a pose are nan.
    """
    good = np.asarray(np.isfinite(link.tip).all(axis=(1, 2)))
    errors_mm = np.full((len(good), link.tip.shape[2]), np.nan)
    errors_mm[good] = (np.linalg.pinv(link.tip[good]) @ tip_residual_mm[good, :, None])[:, :, 0]
    return errors_mm


def carried_by_distances(model: MachineModel, distances_mm: FloatArray, scale_mm: FloatArray) -> dict[Port, FloatArray]:
    """Derivatives by the frame's distances (N, 9), with the scales at (N, m), of what the base carries: base joints in
    {M}, (N, 3 n, 9), and axes of hinges, (N, 3 k, 9), where it has these; by central differences."""
    frame = solve_frame(model.frame, distances_mm + _steps()[:, None])
    return _carried(model, frame, scale_mm)


def _carried_by_plate(model: MachineModel, distances_mm: FloatArray, scale_mm: FloatArray) -> dict[Port, FloatArray]:
    """The same by the plate's points."""
    plates = model.frame.plate_points_M_mm + _steps().reshape(18, 1, 3, 3)
    frame = solve_frame(model.frame._replace(plate_points_M_mm=plates), distances_mm)
    return _carried(model, frame, scale_mm)


def _carried(model: MachineModel, stepped: Frame, scale_mm: FloatArray) -> dict[Port, FloatArray]:
    mechanism, _ = model.links_on(stepped.rotation_M_B, stepped.base_joints_M_mm, scale_mm)
    carried: dict[Port, FloatArray] = {"base_joint": _central_difference(mechanism.base_joints_M_mm, len(scale_mm))}
    if model.hinges[:, 1].any():
        carried["revolute_axis"] = _central_difference(mechanism.revolute_axes, len(scale_mm))
    return carried


def _steps() -> FloatArray:
    """(18, 9): one step forwards for each of nine numbers, then one backwards."""
    return DIFFERENCE_STEP_MM * np.concatenate([np.eye(9), -np.eye(9)])


def _central_difference(stepped_mm: FloatArray, count: int) -> FloatArray:
    """From vectors (18, count, n, 3) after `_steps` to derivatives (count, 3 n, 9)."""
    ends = stepped_mm.reshape(18, count, -1)
    return np.asarray(np.moveaxis((ends[:9] - ends[9:]) / (2 * DIFFERENCE_STEP_MM), 0, 2))


def _pose_by_closure(mechanism: Mechanism, origin_M_mm: FloatArray, rotation_M_P: FloatArray) -> FloatArray:
    """J^-1 (N, 6, 6): displacement and rotation of the platform by n link lengths and k offsets of revolute axes."""
    closure = closure_at(mechanism, origin_M_mm, rotation_M_P)
    lengths = np.concatenate([closure.length_by_displacement, closure.length_by_rotation_mm], axis=2)
    offsets = np.concatenate([closure.offset_by_displacement, closure.offset_by_rotation_mm], axis=2)
    J = np.concatenate([lengths, offsets], axis=1)
    good = np.isfinite(J).all(axis=(1, 2))
    inverse = np.full_like(J, np.nan)
    inverse[good] = np.linalg.inv(J[good])
    return inverse


def _tip_by_pose(model: MachineModel, arm_M_mm: FloatArray, rotation_M_P: FloatArray) -> FloatArray:
    """(N, 3, 6): the tip by displacement v and rotation w of the platform.

    arm_M_mm : (N, 3), r, from the origin of {P} to the tip.
    Tool on the platform: v + w x r in {M}. Tool on the plate: the place on the work moves the other way,
    -R^T (v + w x r) in {P}.
    """
    x, y, z = arm_M_mm.T
    nought = np.zeros_like(x)
    by_rotation = np.stack([nought, z, -y, -z, nought, x, y, -x, nought], axis=1).reshape(-1, 3, 3)  # w x r
    tip_M = np.concatenate([np.broadcast_to(np.eye(3), by_rotation.shape), by_rotation], axis=2)
    if model.arrangement.on_plate:
        return np.asarray(-rotation_M_P.transpose(0, 2, 1) @ tip_M)
    return tip_M


def _extension(model: MachineModel) -> FloatArray:
    """(n, m): 1 where a scale reads the length of a link."""
    own: FloatArray = np.eye(model.scales)[model.actuators.of_link]
    return own * model.extended[:, None]


def _joints_by_scale(model: MachineModel, scale_mm: FloatArray) -> FloatArray:
    """Derivatives (N, 3 n, m) of the base joints in {M} by the scales (N, m); 0 of an extended link."""
    actuators = model.actuators
    angle_rad = ((model.zero.actuator_mm + scale_mm) / actuators.radius_mm)[:, :, None]
    slides = actuators.kinds[:, None] == ACTUATOR_KINDS.index("slides")
    circle = np.cos(angle_rad) * actuators.sine_M - np.sin(angle_rad) * actuators.cosine_M
    along_M = np.where(slides, actuators.cosine_M, circle) * (actuators.kinds[:, None] != 0)
    by_scale = np.zeros((len(scale_mm), model.links, 3, model.scales))
    link = np.arange(model.links)
    by_scale[:, link, :, actuators.of_link] = along_M[:, actuators.of_link].transpose(1, 0, 2)
    return by_scale.reshape(len(scale_mm), 3 * model.links, model.scales)


def _closure_demand(model: MachineModel, rows: Observations, port: Port) -> FloatArray:
    """(N, 6, size): dr - f_q dq of the module docstring per unit of what is added at `port`; link lengths come first,
    then the offsets of the revolute axes."""
    count, n, k = len(rows), rows.links, len(model.revolute_axes_P)
    if port in ("frame", "plate"):
        distances_mm = model.zero.distances_mm + rows.frame_mm
        by = carried_by_distances if port == "frame" else _carried_by_plate
        carried = by(model, distances_mm, rows.scale_mm)
        return np.asarray(sum(_closure_demand(model, rows, part) @ moved for part, moved in carried.items()))
    if port in ("scale", "link", "joint"):
        demand = np.zeros((count, 6, port_size(port, rows)))
        demand[:, :n] = {"scale": _extension(model), "link": np.eye(n), "joint": -model.joint_weights}[port]
        if port == "scale" and model.actuators.kinds.any():
            demand += _closure_demand(model, rows, "base_joint") @ _joints_by_scale(model, rows.scale_mm)
        return demand
    link, axis, of_axis = np.arange(n), np.arange(k), model.hinges[:, 0]
    on_base = model.hinges[:, 1:] == 1
    directions_P = rows.directions_M @ rows.rotation_M_P  # R^T u
    if port == "revolute_axis":
        tilted = np.zeros((count, 6, k, 3))
        directions = np.where(on_base, rows.directions_M[:, of_axis], directions_P[:, of_axis])
        tilted[:, n + axis, axis] = -directions * rows.link_mm[:, of_axis, None]
        return tilted.reshape(count, 6, 3 * k)
    displaced = np.zeros((count, 6, n, 3))
    if port == "base_joint":
        displaced[:, link, link] = rows.directions_M
        displaced[:, n + axis, of_axis] = rows.revolute_axes_M
    else:
        displaced[:, link, link] = -directions_P
        axes_P = np.where(on_base, model.revolute_axes_P @ rows.rotation_M_P, model.revolute_axes_P)  # R^T e, or e
        displaced[:, n + axis, of_axis] = -axes_P
    return displaced.reshape(count, 6, 3 * n)
