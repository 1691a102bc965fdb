"""How the tip of one snapshot moves with what is added at each port of the machine; see `compd.model.sensitivity`,
which does the same for N rows in NumPy, and has the equations."""

from __future__ import annotations

from typing import Any

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.jit import helper
from compd.linear import lu_factor, lu_solve
from compd.model.kernels.actuated_links import closure_by_actuators
from compd.model.kernels.loop_closure import evaluate_closure
from compd.model.kernels.machine_solver import set_distances, solve_frame
from compd.model.kernels.standing_machine import place_standing, stand_on

# As `compd.model.sensitivity.DIFFERENCE_STEP_MM`.
_STEP_MM = 1e-3


@helper
def set_tip_by_closure(
    model: Any, machine: Any, pose: Any, tip_M_mm: FloatArray, tip: FloatArray, by_scale: FloatArray
) -> bool:
    """tip (3, 6), by the lengths of n links and the offsets of the revolute axes: G = (d tip / d pose) J^-1.

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
    closure_by_actuators(
        model.kinds[:m],
        machine.cosine_M[:m],
        machine.sine_M[:m],
        model.radius_mm[:m],
        model.of_link[:n],
        model.hinges[:a],
        pose.actuator_mm[:m],
        J,
        by_scale,
    )
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
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    targets: IntArray,
    moved_frame: Any,
    room: Any,
    tip: FloatArray,
) -> None:
    """tip (3, size), mm per unit of what is added, in the order of `compd.model.effects.effect_program.LIVE_PORTS`.

    machine, by_scale : of `set_tip_by_closure`.  row : of `set_row` at this pose.
    targets : places to which effects add; the port `plate` is 0 where none does.
    moved_frame, room : room for a solved frame and for a machine.
    """
    n, m, a, joints = model.links, model.scales, model.axes, joint_mm.shape[0]
    R, by_closure = pose.rotation_M_P, tip_by_closure
    link = m + joints + 9
    base = link + n
    platform, axis = base + 3 * n, base + 6 * n
    plate = axis + 3 * a
    tool = plate + 9
    with_plate = False
    for i in range(targets.shape[0]):
        with_plate = with_plate or plate <= targets[i] < tool
    tip[:, :] = 0.0
    for c in range(3):
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
        for d in range(3):
            tip[c, tool + d] = R[d, c] if model.tool_on_plate else R[c, d]
    _add_hinges(model, machine, pose, row, by_closure, base, tip)
    length_mm = np.empty(n)
    distances_mm, points_M_mm = np.empty(9), model.plate_points_M_mm.copy()
    set_distances(model, frame_mm, distances_mm)
    for q in range(9):
        for sign in (1.0, -1.0):
            weight = sign / (2.0 * _STEP_MM)
            distances_mm[q] += sign * _STEP_MM
            solve_frame(model, model.plate_points_M_mm, distances_mm, frame.supports_M_mm, moved_frame)
            _stand_moved(model, moved_frame, pose, room, length_mm)
            _add_moved_base(model, base, weight, room, tip, m + joints + q)
            set_distances(model, frame_mm, distances_mm)
            if with_plate:
                points_M_mm[q // 3, q % 3] += sign * _STEP_MM
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
    for c in range(3):
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
    joints_M_mm = np.zeros_like(machine.base_joints_M_mm)
    place_standing(model, machine, pose.actuator_mm, joints_M_mm, length_mm)
    machine.base_joints_M_mm[:, :] = joints_M_mm


@helper
def _add_moved_base(model: Any, base: int, weight: float, machine: Any, tip: FloatArray, column: int) -> None:
    """Add to a column of `tip` what base joints and axes of the base move it, times `weight`: one end of a central
    difference. base : where the base joints begin."""
    n = model.links
    axis = base + 6 * n
    for c in range(3):
        for i in range(n):
            for d in range(3):
                tip[c, column] += weight * tip[c, base + 3 * i + d] * machine.base_joints_M_mm[i, d]
        for h in range(model.axes):
            if model.hinges[h, 1] == 1:
                for d in range(3):
                    tip[c, column] += weight * tip[c, axis + 3 * h + d] * machine.revolute_axes_P[h, d]
