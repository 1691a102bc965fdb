"""How the tip of one snapshot moves with what is added at each port of the machine; see `compd.model.sensitivity`,
which does the same for N rows in NumPy, and has the equations."""

from __future__ import annotations

from typing import Any

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.jit import helper
from compd.linear import lu_factor, lu_solve
from compd.model.kernels.loop_closure import evaluate_closure
from compd.model.kernels.machine_solver import set_distances, solve_frame

# As `compd.model.sensitivity.DIFFERENCE_STEP_MM`.
_STEP_MM = 1e-3


@helper
def set_tip_by_closure(
    model: Any, base_joints_M_mm: FloatArray, pose: Any, tip_M_mm: FloatArray, tip: FloatArray
) -> bool:
    """tip (3, 6), by the lengths of n links and the offsets of the revolute axes: G = (d tip / d pose) J^-1.

    With the tool on the plate, of the touched place in {P}. False where the pose is singular.
    """
    n, a = model.links, model.axes
    R = pose.rotation_M_P
    value_mm, J, pivot = np.empty(6), np.empty((6, 6)), np.empty(6, dtype=np.int64)
    base, platform, axes = base_joints_M_mm[:n], model.platform_joints_P_mm[:n], model.revolute_axes_P[:a]
    if not evaluate_closure(pose.origin_M_mm, R, base, platform, axes, model.hinges[:a], 1.0, value_mm, J):
        return False
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
    frame: Any,
    pose: Any,
    row: Any,
    tip_by_closure: FloatArray,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    targets: IntArray,
    moved_frame: Any,
    tip: FloatArray,
) -> None:
    """tip (3, size), mm per unit of what is added, in the order of `compd.model.effects.effect_program.LIVE_PORTS`.

    row : of `set_row` at this pose.  targets : places to which effects add; the port `plate` is 0 where none does.
    moved_frame : room for a solved frame.
    """
    n, a, joints = model.links, model.axes, joint_mm.shape[0]
    R, by_closure = pose.rotation_M_P, tip_by_closure
    link = n + joints + 9
    base = link + n
    platform, axis = base + 3 * n, base + 6 * n
    plate = axis + 3 * a
    tool = plate + 9
    with_plate = False
    for i in range(targets.shape[0]):
        with_plate = with_plate or plate <= targets[i] < tool
    tip[:, :] = 0.0
    for c in range(3):
        for i in range(n):
            tip[c, i] = tip[c, link + i] = by_closure[c, i]
            for j in range(joints):
                tip[c, n + j] -= model.joint_weights[i, j] * by_closure[c, i]
            for d in range(3):
                direction_P = (
                    R[0, d] * row.directions_M[i, 0]
                    + R[1, d] * row.directions_M[i, 1]
                    + R[2, d] * row.directions_M[i, 2]
                )
                tip[c, base + 3 * i + d] = by_closure[c, i] * row.directions_M[i, d]
                tip[c, platform + 3 * i + d] = -by_closure[c, i] * direction_P
                if i < a:
                    axis_P = model.revolute_axes_P[i]
                    axis_M = R[d, 0] * axis_P[0] + R[d, 1] * axis_P[1] + R[d, 2] * axis_P[2]
                    tip[c, base + 3 * i + d] += by_closure[c, n + i] * axis_M
                    tip[c, platform + 3 * i + d] -= by_closure[c, n + i] * axis_P[d]
                    tip[c, axis + 3 * i + d] = -by_closure[c, n + i] * direction_P * row.link_mm[i]
        for d in range(3):
            tip[c, tool + d] = R[d, c] if model.tool_on_plate else R[c, d]
    distances_mm, points_M_mm = np.empty(9), model.plate_points_M_mm.copy()
    set_distances(model, frame_mm, distances_mm)
    for q in range(9):
        for sign in (1.0, -1.0):
            weight = sign / (2.0 * _STEP_MM)
            distances_mm[q] += sign * _STEP_MM
            solve_frame(model, model.plate_points_M_mm, distances_mm, frame.supports_M_mm, moved_frame)
            _add_moved_base(n, base, weight, moved_frame.base_joints_M_mm, tip, n + joints + q)
            set_distances(model, frame_mm, distances_mm)
            if with_plate:
                points_M_mm[q // 3, q % 3] += sign * _STEP_MM
                solve_frame(model, points_M_mm, distances_mm, frame.supports_M_mm, moved_frame)
                _add_moved_base(n, base, weight, moved_frame.base_joints_M_mm, tip, plate + q)
                points_M_mm[q // 3, q % 3] = model.plate_points_M_mm[q // 3, q % 3]


@helper
def _add_moved_base(
    n: int, base: int, weight: float, base_joints_M_mm: FloatArray, tip: FloatArray, column: int
) -> None:
    """Add to a column of `tip` what base joints (n, 3) move it, times `weight`: one end of a central difference."""
    for c in range(3):
        for i in range(n):
            for d in range(3):
                tip[c, column] += weight * tip[c, base + 3 * i + d] * base_joints_M_mm[i, d]
