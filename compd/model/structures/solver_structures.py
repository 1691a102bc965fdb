"""What the compensation is computed from and what it gives, as C structures; see `compd.compensation.compensation`.

Their arrays have room for six links, six scales and 24 joint comparators. Every field is named as in the models and
results that it is taken from.
"""

from __future__ import annotations

import numpy as np
from numba import from_dtype

from compd.model.structures.effect_row import ROW

MAX_LINKS = 6
MAX_JOINTS = 4 * MAX_LINKS

_LENGTHS = (np.float64, MAX_LINKS)
_POINTS = (np.float64, (MAX_LINKS, 3))
_VECTOR = (np.float64, 3)
_MATRIX = (np.float64, (3, 3))

# Of `compd.model.machine.MachineModel`; axes: of its revolute joints. zero_: of machine zero, base joints with the
# actuators at 0. extends_each: whether each link has an actuator of its own that extends it; what follows are the
# actuators, of `compd.model.kinematics.actuators.Actuators`.
MODEL = np.dtype(
    [
        ("links", np.int64),
        ("scales", np.int64),
        ("joints", np.int64),
        ("axes", np.int64),
        ("tool_on_plate", np.int64),
        ("needs_motion", np.int64),
        ("plate_points_M_mm", *_MATRIX),
        ("joint_offsets_B_mm", *_POINTS),
        ("support_of_joint", np.int64, MAX_LINKS),
        ("zero_supports_M_mm", *_MATRIX),
        ("zero_origin_M_mm", *_VECTOR),
        ("zero_rotation_M_B", *_MATRIX),
        ("platform_joints_P_mm", *_POINTS),
        ("revolute_axes_P", *_MATRIX),
        ("hinges", np.int64, (3, 2)),
        ("tool_mm", *_VECTOR),
        ("joint_weights", np.float64, (MAX_LINKS, MAX_JOINTS)),
        ("zero_base_joints_M_mm", *_POINTS),
        ("zero_distances_mm", np.float64, 9),
        ("extends_each", np.int64),
        ("kinds", np.int64, MAX_LINKS),
        ("cosine_M", *_POINTS),
        ("sine_M", *_POINTS),
        ("radius_mm", *_LENGTHS),
        ("of_link", np.int64, MAX_LINKS),
        ("rod_length_mm", *_LENGTHS),
        ("fixed", np.int64, 6),
        ("zero_actuator_mm", *_LENGTHS),
    ]
)

# One effect of a model: which kernel, and where its parts begin in the arrays of all effects.
# level : what it changes, LENGTHS, MECHANISM or FRAME.
EFFECT = np.dtype(
    [
        ("number", np.int64),
        ("level", np.int64),
        ("size", np.int64),
        ("theta_begin", np.int64),
        ("theta_end", np.int64),
        ("numbers_begin", np.int64),
        ("numbers_end", np.int64),
        ("code_begin", np.int64),
        ("code_end", np.int64),
        ("quantities_begin", np.int64),
        ("quantities_end", np.int64),
        ("memory_begin", np.int64),
        ("memory_end", np.int64),
        ("targets_begin", np.int64),
    ]
)
LENGTHS, MECHANISM, FRAME = range(3)
# Number of an effect without a kernel: what it adds is given.
GIVEN = -1

# The frame, of `compd.model.kinematics.frame.Frame`, with what is on it.
SOLVED_FRAME = np.dtype(
    [
        ("supports_M_mm", *_MATRIX),
        ("origin_M_mm", *_VECTOR),
        ("rotation_M_B", *_MATRIX),
        ("base_joints_M_mm", *_POINTS),
        ("displacement_M_mm", *_VECTOR),
        ("rotation_M_rad", *_VECTOR),
        ("iterations", np.int64, (1,)),
        ("residual_mm", np.float64, (1,)),
        ("reason", np.int64, (1,)),
    ]
)

# The platform, of `compd.model.kinematics.link_kinematics.Pose`, with the base joints of its links; actuator_mm: where
# they move base joints.
SOLVED_POSE = np.dtype(
    [
        ("base_joints_M_mm", *_POINTS),
        ("actuator_mm", *_LENGTHS),
        ("origin_M_mm", *_VECTOR),
        ("rotation_M_P", *_MATRIX),
        ("link_length_mm", *_LENGTHS),
        ("iterations", np.int64, (1,)),
        ("residual_mm", np.float64, (1,)),
        ("reason", np.int64, (1,)),
    ]
)

# The machine between gauges and platform, of `compd.model.prediction.PerturbedMachine`: base joints with the actuators
# at 0, cosine_M and sine_M where the base has turned them; scale_mm: what is added to the scales' readings. What
# follows joint_reason is room for the inverse kinematics.
SOLVED_MACHINE = np.dtype(
    [
        ("cosine_M", *_POINTS),
        ("sine_M", *_POINTS),
        ("scale_mm", *_LENGTHS),
        ("base_joints_M_mm", *_POINTS),
        ("platform_joints_P_mm", *_POINTS),
        ("revolute_axes_P", *_MATRIX),
        ("tool_mm", *_VECTOR),
        ("joint_shortening_mm", *_LENGTHS),
        ("reading_to_length_mm", *_LENGTHS),
        ("joint_reason", np.int64, (1,)),
        ("place_M_mm", *_VECTOR),
        ("closure_mm", np.float64, 6),
        ("jacobian", np.float64, (6, 6)),
        ("factored", np.float64, (6, 6)),
        ("pivot", np.int64, 6),
    ]
)

# Of `Compensation` (compd/compensation); warm_: of `WarmStart`. bare_: by the kinematics alone, without effects.
RESULT = np.dtype(
    [
        ("frame", SOLVED_FRAME),
        ("pose", SOLVED_POSE),
        ("bare_frame", SOLVED_FRAME),
        ("bare_pose", SOLVED_POSE),
        ("tip_M_mm", *_VECTOR),
        ("tip_P_mm", *_VECTOR),
        ("tip_B0_mm", *_VECTOR),
        ("target_M_mm", *_VECTOR),
        ("target_P_mm", *_VECTOR),
        ("target_B_mm", *_VECTOR),
        ("nominal_scale_mm", *_LENGTHS),
        ("scale_setpoint_mm", *_LENGTHS),
        ("correction_mm", *_LENGTHS),
        ("reason", np.int64),
        ("warm_supports_M_mm", *_MATRIX),
        ("warm_origin_M_mm", *_VECTOR),
        ("warm_rotation_M_P", *_MATRIX),
        ("warm_actuator_mm", *_LENGTHS),
    ]
)

# Room for what a row is computed with. at_zero: the machine on its frame at machine zero, standing: on its frame now.
# nominal: of a machine without joints' and frame's errors; command: of the links at the target; with_effects: likewise,
# with the effects added so far.
WORKSPACE = np.dtype(
    [
        ("row", ROW),
        ("at_zero", SOLVED_MACHINE),
        ("standing", SOLVED_MACHINE),
        ("altered", SOLVED_MACHINE),
        ("nominal", SOLVED_POSE),
        ("command", SOLVED_POSE),
        ("with_effects", SOLVED_POSE),
    ]
)

# What the inverse kinematics of one machine is computed in.
INVERSE = np.dtype([("model", MODEL), ("machine", SOLVED_MACHINE), ("pose", SOLVED_POSE)])

MODELS = from_dtype(MODEL)[::1]
EFFECTS = from_dtype(EFFECT)[::1]
RESULTS = from_dtype(RESULT)[::1]
WORKSPACES = from_dtype(WORKSPACE)[::1]
