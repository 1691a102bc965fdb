"""Forward kinematics of links that end in known base joints; `compd.model.kinematics.actuators` has the inverse.

Everything is in {M}, with the base joints where the frame measurement finds them now: the same as working in {B} and
transforming by equations (8) and (9), one transformation shorter.

The machine closes where the contact is made: p + R tip_P = tip_M. A tool on the platform has a fixed tip_P and a
tip_M that moves; a tool on the plate (figure 15) has a fixed tip_M, and tip_P is the place on the work that it touches.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from compd.arrays import FloatArray, IntArray
from compd.model.kernels import closure, forward


class Mechanism(NamedTuple):
    """The parts between base and platform; every array may have leading axes, one entry per row.

    base_joints_M_mm : (..., n, 3), now, in {M}.
    platform_joints_P_mm : (..., n, 3).
    revolute_axes : (..., k, 3), k = 6 - n, unit vectors of the hinges: in {P}, or in {M} where the base carries one.
    hinges : (k, 2), the link of each hinge, from 0, and 1 where its axis is fixed to the base, 0 on the platform; None
        where hinge i belongs to link i on the platform, as in a 3-SPR.
    """

    base_joints_M_mm: FloatArray
    platform_joints_P_mm: FloatArray
    revolute_axes: FloatArray
    hinges: IntArray | None = None


class Pose(NamedTuple):
    """Where the moving platform is.

    origin_M_mm : (..., 3), origin of {P} in {M}.  rotation_M_P : (..., 3, 3), axes of {P} in {M}.
    link_length_mm : (..., n), between joint centres.
    iterations : (...), Newton's.  residual_mm : (...), the worst closing error.
    reason : (...), a Reason; where it is not OK everything else is nan.
    """

    origin_M_mm: FloatArray
    rotation_M_P: FloatArray
    link_length_mm: FloatArray
    iterations: IntArray
    residual_mm: FloatArray
    reason: IntArray


class Closure(NamedTuple):
    """The links at a pose, and how they change with it: by a displacement of {P} in {M}, in mm, and by a rotation
    about {M}'s axes through the origin of {P}, in rad.

    length_mm : (..., n), link lengths; by_displacement (..., n, 3), by_rotation_mm (..., n, 3), in mm per rad.
    offset_mm : (..., k), how far each revolute axis is from square to its link, d_i . R e_i; zero where the
    machine closes; likewise its derivatives (..., k, 3).
    reason : (...), a Reason; where it is not OK everything else is nan.
    """

    length_mm: FloatArray
    length_by_displacement: FloatArray
    length_by_rotation_mm: FloatArray
    offset_mm: FloatArray
    offset_by_displacement: FloatArray
    offset_by_rotation_mm: FloatArray
    reason: IntArray


def check_mechanism(mechanism: Mechanism) -> Mechanism:
    """The mechanism with its hinges, if its arrays have the shapes of n links and k = 6 - n hinges; else ValueError."""
    base, axes, hinges = mechanism.base_joints_M_mm, mechanism.revolute_axes, mechanism.hinges
    links, count = base.shape[-2], axes.shape[-2]
    if links + count != 6 or links < 3 or base.shape[-1] != 3 or axes.shape[-1] != 3:
        raise ValueError(
            f"n links have base joints (n, 3) and 6 - n hinges revolute axes (6 - n, 3), n from 3 to 6; "
            f"these are {base.shape[-2:]} and {axes.shape[-2:]}"
        )
    if hinges is None:
        hinges = hinges_on_platform(count)
    if hinges.shape != (count, 2) or (count and not 0 <= hinges[:, 0].min() <= hinges[:, 0].max() < links):
        raise ValueError(f"hinges are (k, 2), each on a link from 0 to {links - 1}; these are {hinges.tolist()}")
    return mechanism._replace(hinges=hinges)


def hinges_on_platform(count: int) -> IntArray:
    """(count, 2) hinges whose axes are fixed to the platform, hinge i on link i."""
    return np.stack([np.arange(count), np.zeros(count, dtype=np.int64)], axis=1)


def forward_kinematics(
    mechanism: Mechanism, link_length_mm: ArrayLike, guess_origin_M_mm: ArrayLike, guess_rotation_M_P: ArrayLike
) -> Pose:
    """Pose from link lengths: the first step of equation (9).

    Solves |p + R c_i - a_i| = l_i, and (p + R c_i - a_i) . e_h = 0 of each hinge, by Newton's method.

    link_length_mm : (..., n).  guess_origin_M_mm : (..., 3), guess_rotation_M_P : (..., 3, 3), a pose in the same
    assembly: the last cycle's, or machine zero's.
    A row fails as NOT_FINITE; UNREACHABLE (no quadrilateral of two links closes, a length is not positive);
    NO_CONVERGENCE; NEAR_SINGULAR (amplification above AMPLIFICATION_LIMIT); OTHER_ASSEMBLY (a singular pose lies
    between guess and solution, or the platform has turned by more than a right angle).
    Raises ValueError for arrays of a wrong shape.
    """
    return Pose(*forward(*check_mechanism(mechanism), link_length_mm, guess_origin_M_mm, guess_rotation_M_P))


def closure_at(mechanism: Mechanism, origin_M_mm: ArrayLike, rotation_M_P: ArrayLike) -> Closure:
    """Link lengths, squareness of the revolute axes, and their derivatives, at any pose.

    origin_M_mm : (..., 3).  rotation_M_P : (..., 3, 3).
    A row fails as NOT_FINITE, or NEAR_SINGULAR where a link has no length.
    Raises ValueError for arrays of a wrong shape.
    """
    return Closure(*closure(*check_mechanism(mechanism), origin_M_mm, rotation_M_P))
