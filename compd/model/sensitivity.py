"""How the predicted tip changes with what is added at the machine's ports: the derivatives of `predict`.

`compd.model.kernels.tip_sensitivity` has the equations.
"""

from __future__ import annotations

from collections.abc import Collection
from itertools import accumulate, chain, pairwise
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.model.effects import Observations, Port, port_numbers
from compd.model.kernels import PoseRows, SolvedRows, set_sensitivities
from compd.model.kinematics import Pose, solve_frame
from compd.model.machine import MachineModel
from compd.model.structures import RESULT, WORKSPACE

# As `compd.model.kernels.tip_sensitivity.DIFFERENCE_STEP_MM`.
_STEP_MM = 1e-3


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

    For the ports `frame` and `plate` with central differences through the octahedron. Rows without a pose are nan.

    Example: how much a micrometre on each scale moves the tip, (N, 3, n) in um:

        sensitivities(model, rows, ["scale"])["scale"].tip
    """
    rotation_M_B = model.frame.zero_rotation_M_B
    if model.base_turns_parts:
        rotation_M_B = solve_frame(model.frame, model.zero.distances_mm + rows.frame_mm).rotation_M_B
    place = (rows.origin_M_mm, rows.rotation_M_P, rows.tip_M_mm, rows.scale_mm, rows.frame_mm)
    moved = _by_ports(model, ports, PoseRows(rotation_M_B, rows.base_joints_M_mm, *place))
    if "reference" in ports:
        moved["reference"] = np.broadcast_to(np.eye(6), (len(rows), 6, 6))
    lengths = {"scale": _extension(model), "link": np.eye(rows.links), "joint": -model.joint_weights}
    by_port: dict[Port, Sensitivity] = {}
    for port, by in moved.items():
        shape = (rows.links, by.shape[2])
        link_length = np.broadcast_to(lengths.get(port, np.zeros(shape)), (len(rows), *shape))
        by_port[port] = Sensitivity(by[:, :3], by[:, 3:], link_length)
    return by_port


def tip_by_scales(
    model: MachineModel,
    rotation_M_B: FloatArray,
    base_joints_M_mm: FloatArray,
    pose: Pose,
    tip_M_mm: FloatArray,
    scale_mm: FloatArray,
) -> FloatArray:
    """Derivatives (N, 3, m), mm per mm, of the tip by the scales: how far one that shows more moves it.

    rotation_M_B : the base's axes.  base_joints_M_mm : (N, n, 3), where the scales (N, m) have moved them.
    pose : of N rows.  tip_M_mm : (N, 3), where the tool touches.
    With the tool on the plate the derivatives are those of the touched place in {P}. Rows without a pose are nan.
    """
    place = (pose.origin_M_mm, pose.rotation_M_P, tip_M_mm, scale_mm, np.zeros((1, 0)))
    return _by_ports(model, ["scale"], PoseRows(rotation_M_B, base_joints_M_mm, *place))["scale"][:, :3]


def _by_ports(model: MachineModel, ports: Collection[Port], rows: PoseRows) -> dict[Port, FloatArray]:
    """(N, 6, size) of each port of the machine: tip and rotation by what is added there."""
    numbers = port_numbers(model.links, model.joint_weights.shape[1], len(model.revolute_axes_P))
    asked = {port: numbers[port] for port in ports if port in numbers}
    count, cores = len(rows.scale_mm), (2, 2, 1, 2, 1, 1, 1)
    moved = np.empty((count, 6, sum(map(len, asked.values()))))
    # contiguous copies, since the kernel takes no read-only array
    copies = [
        np.array(np.broadcast_to(values, (count, *values.shape[-core:])), dtype=np.float64, order="C")
        for values, core in zip(rows, cores, strict=True)
    ]
    targets = np.array([*chain(*asked.values())], dtype=np.int64)
    room = SolvedRows(np.zeros(1, WORKSPACE), np.zeros(1, RESULT))
    set_sensitivities(model.structure, PoseRows(*copies), targets, room, moved)
    ends = accumulate(map(len, asked.values()), initial=0)
    return {port: moved[:, :, begin:end] for port, (begin, end) in zip(asked, pairwise(ends), strict=True)}


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
    steps = _STEP_MM * np.concatenate([np.eye(9), -np.eye(9)])
    frame = solve_frame(model.frame, distances_mm + steps[:, None])
    mechanism, _ = model.links_on(frame.rotation_M_B, frame.base_joints_M_mm, scale_mm)
    carried: dict[Port, FloatArray] = {"base_joint": _central_difference(mechanism.base_joints_M_mm, len(scale_mm))}
    if model.hinges[:, 1].any():
        carried["revolute_axis"] = _central_difference(mechanism.revolute_axes, len(scale_mm))
    return carried


def _central_difference(stepped_mm: FloatArray, count: int) -> FloatArray:
    """From vectors (18, count, n, 3), nine steps forwards and nine backwards, to derivatives (count, 3 n, 9)."""
    ends = stepped_mm.reshape(18, count, -1)
    return np.asarray(np.moveaxis((ends[:9] - ends[9:]) / (2 * _STEP_MM), 0, 2))


def _extension(model: MachineModel) -> FloatArray:
    """(n, m): 1 where a scale reads the length of a link."""
    own: FloatArray = np.eye(model.scales)[model.actuators.of_link]
    return own * model.extended[:, None]
