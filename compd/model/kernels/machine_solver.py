"""Frame, pose and contact of a machine whose parts are C structures; see `solver_structures`.

numba compiles a solver anew for each combination of its arguments' types. An array of a structure is of another type
than one outside; a slice of either, `[:]`, is of the same.
"""

from __future__ import annotations

from typing import Any

from compd.arrays import FloatArray
from compd.jit import helper
from compd.model.kernels.octahedron_frame import solve_octahedron
from compd.rotation import to_inner_frame, to_outer_frame


@helper
def solve_frame(
    model: Any, plate_points_M_mm: FloatArray, distances_mm: FloatArray, guess_M_mm: FloatArray, frame: Any
) -> None:
    """Equation (3); see `compd.model.kinematics.frame.solve_frame`."""
    n = model.links
    solve_octahedron(
        distances_mm,
        plate_points_M_mm[:],
        guess_M_mm[:],
        model.joint_offsets_B_mm[:n],
        model.support_of_joint[:n],
        model.zero_origin_M_mm,
        model.zero_rotation_M_B,
        frame.supports_M_mm,
        frame.origin_M_mm,
        frame.rotation_M_B,
        frame.base_joints_M_mm[:n],
        frame.displacement_M_mm,
        frame.rotation_M_rad,
        frame.iterations,
        frame.residual_mm,
        frame.reason,
    )


@helper
def frame_change_mm(frame_mm: FloatArray, i: int) -> float:
    """Of distance i of t1..t3, u1..u6 since machine zero; 0 of one that is not measured.

    frame_mm : (9,), (6,) of u1..u6 alone, or (0,).
    """
    place = i - 9 + frame_mm.shape[0]
    return float(frame_mm[place]) if place >= 0 else 0.0


@helper
def set_distances(model: Any, frame_mm: FloatArray, distances_mm: FloatArray) -> None:
    """The frame's nine distances, equations (6) and (7); frame_mm as in `frame_change_mm`."""
    for i in range(9):
        distances_mm[i] = model.zero_distances_mm[i] + frame_change_mm(frame_mm, i)


@helper
def set_contact(model: Any, pose: Any, tool_mm: FloatArray, tip_M_mm: FloatArray, tip_P_mm: FloatArray) -> None:
    """Where the tool touches at a pose; see `compd.model.kinematics.tool`."""
    if model.tool_on_plate:
        tip_M_mm[:] = tool_mm
        to_inner_frame(pose.rotation_M_P, pose.origin_M_mm, tool_mm, tip_P_mm)
    else:
        tip_P_mm[:] = tool_mm
        to_outer_frame(pose.rotation_M_P, pose.origin_M_mm, tool_mm, tip_M_mm)


@helper
def copy_frame(source: Any, copy: Any) -> None:
    copy.supports_M_mm = source.supports_M_mm
    copy.origin_M_mm = source.origin_M_mm
    copy.rotation_M_B = source.rotation_M_B
    copy.base_joints_M_mm = source.base_joints_M_mm
    copy.displacement_M_mm = source.displacement_M_mm
    copy.rotation_M_rad = source.rotation_M_rad
    copy.iterations = source.iterations
    copy.residual_mm = source.residual_mm
    copy.reason = source.reason


@helper
def copy_pose(source: Any, copy: Any) -> None:
    copy.base_joints_M_mm = source.base_joints_M_mm
    copy.actuator_mm = source.actuator_mm
    copy.origin_M_mm = source.origin_M_mm
    copy.rotation_M_P = source.rotation_M_P
    copy.link_length_mm = source.link_length_mm
    copy.iterations = source.iterations
    copy.residual_mm = source.residual_mm
    copy.reason = source.reason
