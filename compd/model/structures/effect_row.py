"""What the kernel of an effect is computed from: one instant of a machine, under the names of `Observations`.

Both are C structures, handed from function to function by a pointer. Their arrays have room for the largest machine;
`links` and `scales` say how many places are in use.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numba import from_dtype

# Room for parallel machines with more links than compd knows the kinematics of, such as cable robots with eight; and
# for all joint comparators that a link can have: S, B, Ra and Rb.
MAX_LINKS = 16
MAX_JOINTS = 4 * MAX_LINKS

# Fields as in `compd.model.effects.observations.Observations`, for one instant.
ROW = np.dtype(
    [
        ("links", np.int64),
        ("scales", np.int64),
        ("scale_mm", np.float64, MAX_LINKS),
        ("joint_mm", np.float64, MAX_JOINTS),
        ("frame_mm", np.float64, 9),
        ("time_s", np.float64),
        ("session_start", np.int64),
        ("direction", np.float64, MAX_LINKS),
        ("velocity_mm_per_s", np.float64, MAX_LINKS),
        ("joint_velocity_mm_per_s", np.float64, MAX_JOINTS),
        ("link_mm", np.float64, MAX_LINKS),
        ("directions_M", np.float64, (MAX_LINKS, 3)),
        ("base_joints_M_mm", np.float64, (MAX_LINKS, 3)),
        ("origin_M_mm", np.float64, 3),
        ("rotation_M_P", np.float64, (3, 3)),
        ("tip_M_mm", np.float64, 3),
    ]
)

# Fields as in `compd.model.effects.MachineConstants`; links and axes: of its kinematics, 0 where that is unknown.
MACHINE = np.dtype(
    [
        ("links", np.int64),
        ("axes", np.int64),
        ("platform_joints_P_mm", np.float64, (MAX_LINKS, 3)),
        ("revolute_axes_P", np.float64, (3, 3)),
        ("hinges", np.int64, (3, 2)),
        ("scale_of_link", np.int64, MAX_LINKS),
        ("kinds", np.int64, MAX_LINKS),
        ("cosine_M", np.float64, (MAX_LINKS, 3)),
        ("sine_M", np.float64, (MAX_LINKS, 3)),
        ("radius_mm", np.float64, MAX_LINKS),
        ("zero_actuator_mm", np.float64, MAX_LINKS),
        ("tool_mm", np.float64, 3),
        ("tool_on_plate", np.int64),
        ("zero_directions_M", np.float64, (MAX_LINKS, 3)),
        ("zero_axes_M", np.float64, (MAX_LINKS, 3)),
        ("zero_axial_force_N", np.float64, MAX_LINKS),
        ("zero_axial_per_force", np.float64, (MAX_LINKS, 3)),
        ("zero_rotation_M_P", np.float64, (3, 3)),
        ("weight_N", np.float64),
        ("weight_at_P_mm", np.float64, 3),
        ("frame_zero_mm", np.float64, 9),
        ("plate_points_M_mm", np.float64, (3, 3)),
        ("plate_thickness_mm", np.float64),
        ("instrument_M_mm", np.float64, 3),
    ]
)

# For kernels' signatures, which numba infers; what an attribute of one is, its field above tells.
EffectRow: TypeAlias = Any
EffectMachine: TypeAlias = Any

EFFECT_ROWS = from_dtype(ROW)[::1]
EFFECT_MACHINE = from_dtype(MACHINE)[::1]
