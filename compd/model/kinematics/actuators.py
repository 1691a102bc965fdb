"""Machines whose actuators extend links, or move base joints along a line or around a circle.

The links' ends follow from the actuators (`links_at`); from there on `forward_kinematics`, `closure_at` and
`link_forces` serve every machine. The inverse has the actuators as unknowns.
"""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import ArrayLike

from compd.arrays import FloatArray, IntArray
from compd.model.kernels import inverse, placed_links
from compd.model.kinematics.link_kinematics import Mechanism, Pose, check_mechanism

# In the order of their numbers in `compd.model.kernels.actuated_links`.
ACTUATOR_KINDS = ("extends", "slides", "turns")


class Actuators(NamedTuple):
    """What moves the links; every vector in {M}.

    kinds : (m,), 0 extends, 1 slides, 2 turns.
    cosine_M : (m, 3), unit vector along which an actuator slides, or from the centre to the base joint at angle 0.
    sine_M : (m, 3), the same at a right angle; of no influence where the actuator does not turn.
    radius_mm : (m,), of the circle; 1 where it does not turn.
    of_link : (n,), the actuator of each link, from 0.
    rod_length_mm : (n,), the link's length; of a link that is extended, its length at actuator 0.
    fixed : (6,), 1 for each coordinate that a target fixes: x, y, z of the tip, turns about x, y, z of {M}.
    """

    kinds: IntArray
    cosine_M: FloatArray
    sine_M: FloatArray
    radius_mm: FloatArray
    of_link: IntArray
    rod_length_mm: FloatArray
    fixed: IntArray


class ActuatedPose(NamedTuple):
    """A pose with what reaches it: actuator_mm (..., m), and the base joints base_joints_M_mm (..., n, 3) there."""

    pose: Pose
    actuator_mm: FloatArray
    base_joints_M_mm: FloatArray


def links_at(
    actuators: Actuators, base_joints_M_mm: ArrayLike, actuator_mm: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Base joints (..., n, 3) in {M}, and link lengths (..., n), with the actuators at actuator_mm (..., m).

    base_joints_M_mm : (..., n, 3), with sliding actuators at 0; of a turning one the centre of its circle.
    actuator_mm : a turning actuator's arc, radius times angle.
    """
    moving = actuators[:5]
    joints, lengths = placed_links(*moving, base_joints_M_mm, actuators.rod_length_mm, actuator_mm)
    return joints, lengths


def inverse_kinematics(
    mechanism: Mechanism,
    actuators: Actuators,
    tip_M_mm: ArrayLike,
    tip_P_mm: ArrayLike,
    rotation_M_P: ArrayLike,
    guess_mm: ArrayLike,
) -> ActuatedPose:
    """Pose and actuators from what the target fixes: the second step of equation (8).

    By Newton's method in the actuators and the free coordinates.

    mechanism : base joints as in `links_at`.  tip_M_mm, tip_P_mm : (..., 3), the contact in {M} and in {P}.
    rotation_M_P : (..., 3, 3), the attitude wanted. Coordinates that the target leaves free are the guess to start
    from; a free turn about z leaves R(z) rotation_M_P.  guess_mm : (..., m), as machine zero's or the last cycle's.
    A row fails as NOT_FINITE; UNREACHABLE (a base joint and its platform joint would coincide); NO_CONVERGENCE;
    OTHER_ASSEMBLY; NEAR_SINGULAR (the lengths would not hold the pose, or the target's coordinates do not fix it).
    Raises ValueError for arrays of a wrong shape.
    """
    origin, rotation, actuator_mm, lengths, joints, iterations, residual, reason = inverse(
        *check_mechanism(mechanism), *actuators, tip_M_mm, tip_P_mm, rotation_M_P, guess_mm
    )
    return ActuatedPose(Pose(origin, rotation, lengths, iterations, residual, reason), actuator_mm, joints)
