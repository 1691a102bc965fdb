"""Forces in the links, for a load and the platform's weight, by virtual work.

With x the pose and J = d(l, o)/dx the closure's derivatives (`kernels.closure`), l the link lengths and o the offsets
of the revolute axes, a virtual displacement dx lets the load do the work W . dx and the links take J dx times their
forces. Equilibrium for every dx is

    J^T (axial, -lateral) = W,   W = (force, moment about the origin of {P}).

It is solved with moments divided by the platform's radius, so that all entries of J are pure numbers.
"""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import ArrayLike

from compd.arrays import FloatArray, IntArray
from compd.model.kernels import forces
from compd.model.kinematics.link_kinematics import Mechanism, check_mechanism


class LinkForces(NamedTuple):
    """What the links carry.

    axial_N : (..., n), positive in tension.
    lateral_N : (..., k), along the revolute axis of link i, on the platform; empty for a hexapod.
    reason : (...), a Reason; where it is not OK the forces are nan.
    """

    axial_N: FloatArray
    lateral_N: FloatArray
    reason: IntArray


def link_forces(
    mechanism: Mechanism,
    origin_M_mm: ArrayLike,
    rotation_M_P: ArrayLike,
    force_M_N: ArrayLike,
    at_M_mm: ArrayLike,
    weight_N: ArrayLike,
    weight_at_P_mm: ArrayLike,
) -> LinkForces:
    """Equilibrium of the moving platform (module docstring). Links weigh nothing; weight pulls along -z of {M}.

    A link's force passes through its base joint, a sphere, in the plane of the link and its revolute axis: so it has
    an axial part and, on the tripod, one lateral part along the revolute axis, which is square to the link.

    origin_M_mm (..., 3), rotation_M_P (..., 3, 3): the pose.  force_M_N (..., 3): the external force on whatever the
    platform carries, acting at at_M_mm (..., 3).  weight_N (...): the platform's, at weight_at_P_mm (..., 3).
    A row fails as NOT_FINITE, or NEAR_SINGULAR where finite link forces cannot hold the load.

    Example: the tripod at machine zero carries its platform of 80 N alone. Its links lean by 450 mm down on a length of
    481.04 mm, so that each pulls with 80 / 3 x 481.04 / 450 = 28.5 N, and no lateral force is left.
    Raises ValueError for arrays of a wrong shape.
    """
    return LinkForces(
        *forces(*check_mechanism(mechanism), origin_M_mm, rotation_M_P, force_M_N, at_M_mm, weight_N, weight_at_P_mm)
    )
