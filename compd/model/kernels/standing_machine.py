"""A machine, and its forward kinematics, on a frame that has moved, and with what effects add.

What a base carries turns with it: the rails and circles of its actuators, and the axes of its hinges.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.jit import helper
from compd.model.kernels.actuated_links import EXTENDS, place_links
from compd.model.kernels.forward_solver import solve_forward
from compd.rotation import to_inner_frame, to_outer_frame


@helper
def stand_on(model: Any, rotation_M_B: FloatArray, base_joints_M_mm: FloatArray, machine: Any) -> None:
    """The machine on a base of these axes; base_joints_M_mm (n, 3) with the actuators at 0."""
    stand_parts(model, rotation_M_B, base_joints_M_mm, machine)
    machine.reading_to_length_mm[:] = 0.0
    machine.joint_shortening_mm[:] = 0.0


@helper
def stand_parts(model: Any, rotation_M_B: FloatArray, base_joints_M_mm: FloatArray, machine: Any) -> None:
    """As `stand_on`, with what is added to the lengths as it was."""
    machine.base_joints_M_mm = base_joints_M_mm
    machine.platform_joints_P_mm = model.platform_joints_P_mm
    machine.revolute_axes_P = model.revolute_axes_P
    machine.tool_mm = model.tool_mm
    for a in range(model.scales):
        if model.kinds[a] != EXTENDS:
            turn_with_base(model, rotation_M_B, model.cosine_M[a], machine.cosine_M[a])
            turn_with_base(model, rotation_M_B, model.sine_M[a], machine.sine_M[a])
    for h in range(model.axes):
        if model.hinges[h, 1] == 1:
            turn_with_base(model, rotation_M_B, model.revolute_axes_P[h], machine.revolute_axes_P[h])


@helper
def turn_with_base(model: Any, rotation_M_B: FloatArray, vector_M: FloatArray, turned_M: FloatArray) -> None:
    """A direction that the base carries, from machine zero to a base of these axes."""
    along_B, origin = np.empty(3), np.zeros(3)
    to_inner_frame(model.zero_rotation_M_B, origin, vector_M, along_B)
    to_outer_frame(rotation_M_B, origin, along_B, turned_M)


@helper
def place_standing(
    model: Any, machine: Any, actuator_mm: FloatArray, joints_M_mm: FloatArray, length_mm: FloatArray
) -> None:
    """Base joints and link lengths with the actuators at actuator_mm; see `place_links`."""
    n, m = model.links, model.scales
    place_links(
        model.kinds[:m],
        machine.cosine_M[:m],
        machine.sine_M[:m],
        model.radius_mm[:m],
        model.of_link[:n],
        machine.base_joints_M_mm[:n],
        model.rod_length_mm[:n],
        actuator_mm[:m],
        joints_M_mm[:n],
        length_mm[:n],
    )


@helper
def place_with_added(model: Any, machine: Any, pose: Any) -> None:
    """Base joints and link lengths with the actuators of the pose, and what joints and effects add to the lengths."""
    place_standing(model, machine, pose.actuator_mm, pose.base_joints_M_mm, pose.link_length_mm)
    for i in range(model.links):
        pose.link_length_mm[i] += machine.reading_to_length_mm[i] - machine.joint_shortening_mm[i]


@helper
def forward_standing(
    model: Any,
    machine: Any,
    scale_mm: FloatArray,
    guess_origin_M_mm: FloatArray,
    guess_rotation_M_P: FloatArray,
    pose: Any,
) -> None:
    """The pose at readings of the scales (m,), with what the machine's joints and effects add to the links."""
    n, k = model.links, model.axes
    for a in range(model.scales):
        pose.actuator_mm[a] = model.zero_actuator_mm[a] + scale_mm[a]
    place_with_added(model, machine, pose)
    solve_forward(
        pose.base_joints_M_mm[:n],
        machine.platform_joints_P_mm[:n],
        machine.revolute_axes_P[:k],
        model.hinges[:k],
        pose.link_length_mm[:n],
        guess_origin_M_mm[:],
        guess_rotation_M_P[:],
        pose.origin_M_mm,
        pose.rotation_M_P,
        pose.link_length_mm[:n],
        pose.iterations,
        pose.residual_mm,
        pose.reason,
    )
