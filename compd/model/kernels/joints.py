"""What the joint comparators say of the links, as a kernel: equation (1)."""

from __future__ import annotations

import math

from compd.arrays import FloatArray, IntArray
from compd.jit import INTEGERS, MATRIX, VECTOR, helper, kernel
from compd.linear import all_finite
from compd.model.kernels.reason_codes import NOT_FINITE, OK


@helper
def shorten_by_joints(
    joint_weights: FloatArray, joint_mm: FloatArray, shortening_mm: FloatArray, reason: IntArray
) -> None:
    """gB_i + gS_i of equation (1), (..., n), in mm, and the reason (...): OK or NOT_FINITE.

    joint_weights : (n, k), what comparator k counts for link i: 1 for S and B, 1/2 for Ra and Rb.
    joint_mm : (..., k), change since machine zero. One that is not finite takes its whole row with it.
    """
    reason[0] = OK if all_finite(joint_mm) else NOT_FINITE
    if reason[0] != OK:
        shortening_mm[:] = math.nan
        return
    for i in range(shortening_mm.shape[0]):
        shortening_mm[i] = 0.0
        for k in range(joint_mm.shape[0]):
            shortening_mm[i] += joint_weights[i, k] * joint_mm[k]


joint_shortening = kernel([MATRIX, VECTOR, VECTOR, INTEGERS], "(n,k),(k)->(n),()")(shorten_by_joints)
