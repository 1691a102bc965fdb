"""How the tip of a machine moves, and the platform turns, with what is added at each port.

The pose x = (displacement of {P} in mm, rotation about {M}'s axes in rad) satisfies the closure of the links,

    |d_i| = l_i  for each link i,   d_i . R e_i = 0  for each revolute axis i,   d_i = p + R c_i - a_i,

six equations f(x, q) = r with r = (l, 0), where q stands for whatever the ports change: base joints a_i, platform
joints c_i, revolute axes e_i. To first order a change of q or r moves the pose by

    dx = J^-1 (dr - f_q dq),   J = f_x   (6 x 6).

With u_i the unit vector of link i, the bracket per unit of what is added at a port has for link i and axis i

    link             1                         joint            minus the joint weights, equation (1)
    base_joint       u_i and R e_i             platform_joint   -R^T u_i and -e_i, in {P}
    revolute_axis    -R^T d_i, in {P}          frame, plate     those of what the base carries, base_joint and
                                                                revolute_axis, times d / d (distances or points)
    scale            1 of an extended link; those of base_joint times d a / d q where the actuator moves the joint

An axis that the base carries is e_i, in {M}, in place of R e_i.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.jit import INDICES, ROW_MATRICES, helper, loop
from compd.linear import lu_factor, lu_solve
from compd.model.kernels.actuated_links import closure_by_actuators
from compd.model.kernels.loop_closure import evaluate_closure
from compd.model.kernels.machine_solver import set_distances, solve_frame
from compd.model.kernels.row_arguments import POSE_ROWS, SOLVED_ROWS, PoseRows, SolvedRows
from compd.model.kernels.standing_machine import place_standing, stand_on
from compd.model.structures import MODELS

# Step of the central differences through the octahedron, whose sides are about 1 m: the difference's own error is of
# order (1e-3 / 1e3)^2 = 1e-12, and rounding of coordinates, 1e-13 mm, makes 1e-10 of it.
DIFFERENCE_STEP_MM = 1e-3


@helper
def set_tip_by_closure(
    model: Any, machine: Any, pose: Any, row: Any, tip_M_mm: FloatArray, tip: FloatArray, by_scale: FloatArray
) -> bool:
    """tip (3, 6), by the lengths of n links and the offsets of the revolute axes: G = (d tip / d pose) J^-1.

    tip (6, 6) : with the platform's rotation behind it.  row : gets lengths and directions of the links.

    machine : that has the platform joints, revolute axes and directions of the actuators as they stand.
    by_scale (6, m) : by how much the scales lengthen the links and lower the offsets, for tip @ by_scale.
    With the tool on the plate, of the touched place in {P}. False where the pose is singular.
    """
    n, m, a = model.links, model.scales, model.axes
    R = pose.rotation_M_P
    value_mm, J, pivot = np.empty(6), np.empty((6, 6)), np.empty(6, dtype=np.int64)
    base, platform, axes = pose.base_joints_M_mm[:n], machine.platform_joints_P_mm[:n], machine.revolute_axes_P[:a]
    if not evaluate_closure(pose.origin_M_mm, R, base, platform, axes, model.hinges[:a], 1.0, value_mm, J):
        return False
    for i in range(n):
        row.link_mm[i] = value_mm[i]
        row.directions_M[i] = J[i, :3]
    closure_by_actuators(model, machine, pose.actuator_mm, J, by_scale)
    for i in range(6):
        for j in range(m):
            by_scale[i, j] = -by_scale[i, j]
    if lu_factor(J, pivot) == 0.0:
        return False
    x, y, z = (
        tip_M_mm[0] - pose.origin_M_mm[0],
        tip_M_mm[1] - pose.origin_M_mm[1],
        tip_M_mm[2] - pose.origin_M_mm[2],
    )
    column = np.empty(6)
    for i in range(6):
        for j in range(6):
            column[j] = 1.0 if i == j else 0.0
        lu_solve(J, pivot, column)
        # displacement and w x r
        dx = column[0] + column[4] * z - column[5] * y
        dy = column[1] + column[5] * x - column[3] * z
        dz = column[2] + column[3] * y - column[4] * x
        for j in range(3):
            if model.tool_on_plate:
                tip[j, i] = -(R[0, j] * dx + R[1, j] * dy + R[2, j] * dz)
            else:
                tip[j, i] = dx if j == 0 else (dy if j == 1 else dz)
        for j in range(3, tip.shape[0]):
            tip[j, i] = column[j]
    return True


@helper
def set_tip_by_ports(
    model: Any,
    machine: Any,
    frame: Any,
    pose: Any,
    row: Any,
    tip_by_closure: FloatArray,
    by_scale: FloatArray,
    frame_mm: FloatArray,
    targets: IntArray,
    moved_frame: Any,
    room: Any,
    tip: FloatArray,
) -> None:
    """tip (3, size), mm per unit of what is added, in the order of `compd.model.effects.LIVE_PORTS`; or (6, size).

    machine, row, by_scale, tip_by_closure : of `set_tip_by_closure`.
    targets : places of `tip` that are asked for; the ports `frame` and `plate` are 0 where none is theirs.
    moved_frame, room : room for a solved frame and for a machine.
    """
    n, m, a, joints = model.links, model.scales, model.axes, model.joints
    R, by_closure = pose.rotation_M_P, tip_by_closure
    link = m + joints + 9
    base = link + n
    platform, axis = base + 3 * n, base + 6 * n
    plate = axis + 3 * a
    tool = plate + 9
    with_frame = with_plate = False
    for i in range(targets.shape[0]):
        with_frame = with_frame or m + joints <= targets[i] < link
        with_plate = with_plate or plate <= targets[i] < tool
    tip[:, :] = 0.0
    for c in range(tip.shape[0]):
        for i in range(m):
            for j in range(6):
                tip[c, i] += by_closure[c, j] * by_scale[j, i]
        for i in range(n):
            tip[c, link + i] = by_closure[c, i]
            for j in range(joints):
                tip[c, m + j] -= model.joint_weights[i, j] * by_closure[c, i]
            for d in range(3):
                direction_P = (
                    R[0, d] * row.directions_M[i, 0]
                    + R[1, d] * row.directions_M[i, 1]
                    + R[2, d] * row.directions_M[i, 2]
                )
                tip[c, base + 3 * i + d] = by_closure[c, i] * row.directions_M[i, d]
                tip[c, platform + 3 * i + d] = -by_closure[c, i] * direction_P
        for d in range(3 if c < 3 else 0):
            tip[c, tool + d] = R[d, c] if model.tool_on_plate else R[c, d]
    _add_hinges(model, machine, pose, row, by_closure, base, tip)
    length_mm = np.empty(n)
    distances_mm, points_M_mm = np.empty(9), model.plate_points_M_mm.copy()
    set_distances(model, frame_mm, distances_mm)
    for q in range(9):
        for sign in (1.0, -1.0):
            weight = sign / (2.0 * DIFFERENCE_STEP_MM)
            if with_frame:
                distances_mm[q] += sign * DIFFERENCE_STEP_MM
                solve_frame(model, model.plate_points_M_mm, distances_mm, frame.supports_M_mm, moved_frame)
                _stand_moved(model, moved_frame, pose, room, length_mm)
                _add_moved_base(model, base, weight, room, tip, m + joints + q)
                set_distances(model, frame_mm, distances_mm)
            if with_plate:
                points_M_mm[q // 3, q % 3] += sign * DIFFERENCE_STEP_MM
                solve_frame(model, points_M_mm, distances_mm, frame.supports_M_mm, moved_frame)
                _stand_moved(model, moved_frame, pose, room, length_mm)
                _add_moved_base(model, base, weight, room, tip, plate + q)
                points_M_mm[q // 3, q % 3] = model.plate_points_M_mm[q // 3, q % 3]


@helper
def _add_hinges(
    model: Any, machine: Any, pose: Any, row: Any, by_closure: FloatArray, base: int, tip: FloatArray
) -> None:
    """Add what base joints, platform joints and axes do through the hinges; base : where the base joints begin."""
    n, R = model.links, pose.rotation_M_P
    platform, axis = base + 3 * n, base + 6 * n
    for c in range(tip.shape[0]):
        for h in range(model.axes):
            i, on_base, e = model.hinges[h, 0], model.hinges[h, 1] == 1, machine.revolute_axes_P[h]
            direction_M = row.directions_M[i]
            by = by_closure[c, n + h]
            for d in range(3):
                outer = R[d, 0] * e[0] + R[d, 1] * e[1] + R[d, 2] * e[2]
                inner = R[0, d] * e[0] + R[1, d] * e[1] + R[2, d] * e[2]
                inward = R[0, d] * direction_M[0] + R[1, d] * direction_M[1] + R[2, d] * direction_M[2]
                tip[c, base + 3 * i + d] += by * (e[d] if on_base else outer)
                tip[c, platform + 3 * i + d] -= by * (inner if on_base else e[d])
                tip[c, axis + 3 * h + d] = -by * (direction_M[d] if on_base else inward) * row.link_mm[i]


@helper
def _stand_moved(model: Any, frame: Any, pose: Any, machine: Any, length_mm: FloatArray) -> None:
    """The machine on a frame that has moved, its base joints where the actuators of the pose have them."""
    stand_on(model, frame.rotation_M_B, frame.base_joints_M_mm, machine)
    place_standing(model, machine, pose.actuator_mm, machine.base_joints_M_mm, length_mm)


@helper
def _add_moved_base(model: Any, base: int, weight: float, machine: Any, tip: FloatArray, column: int) -> None:
    """Add to a column of `tip` what base joints and axes of the base move it, times `weight`: one end of a central
    difference. base : where the base joints begin."""
    n = model.links
    axis = base + 6 * n
    for c in range(tip.shape[0]):
        for i in range(n):
            for d in range(3):
                tip[c, column] += weight * tip[c, base + 3 * i + d] * machine.base_joints_M_mm[i, d]
        for h in range(model.axes):
            if model.hinges[h, 1] == 1:
                for d in range(3):
                    tip[c, column] += weight * tip[c, axis + 3 * h + d] * machine.revolute_axes_P[h, d]


@loop([MODELS, POSE_ROWS, INDICES, SOLVED_ROWS, ROW_MATRICES])
def set_sensitivities(
    models: Any, rows: PoseRows, targets: IntArray, solved: SolvedRows, sensitivities: FloatArray
) -> None:
    """Tip and rotation of N rows, (N, 6, T), by T numbers of `set_tip_by_ports`; nan where there is no pose.

    models (1,).  solved : room.
    """
    model, work, result = models[0], solved.works[0], solved.results[0]
    n, m, j = model.links, model.scales, model.joints
    frame, pose, standing, zero_mm = result.bare_frame, result.bare_pose, work.standing, model.zero_base_joints_M_mm
    by_closure, by_scale = np.empty((6, 6)), np.empty((6, m))
    by_port, distances_mm = np.empty((6, m + j + 21 + 7 * n + 3 * model.axes)), np.empty(9)
    for r in range(sensitivities.shape[0]):
        sensitivities[r] = math.nan
        stand_on(model, rows.rotation_M_B[r], zero_mm, standing)
        pose.base_joints_M_mm[:n] = rows.base_joints_M_mm[r]
        pose.origin_M_mm[:] = rows.origin_M_mm[r]
        pose.rotation_M_P[:, :] = rows.rotation_M_P[r]
        pose.actuator_mm[:m] = model.zero_actuator_mm[:m] + rows.scale_mm[r]
        if not set_tip_by_closure(model, standing, pose, work.row, rows.tip_M_mm[r], by_closure, by_scale):
            continue
        frame_mm = rows.frame_mm[r]
        set_distances(model, frame_mm, distances_mm)
        solve_frame(model, model.plate_points_M_mm, distances_mm, model.zero_supports_M_mm, frame)
        set_tip_by_ports(
            model, standing, frame, pose, work.row, by_closure, by_scale, frame_mm, targets, result.frame, work.at_zero,
            by_port,
        )  # fmt: skip
        for i in range(6):
            for c in range(targets.shape[0]):
                sensitivities[r, i, c] = by_port[i, targets[c]]
