"""Link lengths from scales and joint comparators, equation (1)."""

from __future__ import annotations

import math

from compd.arrays import FloatArray, IntArray
from compd.model.kernels.jit import INTEGERS, MATRIX, VECTOR, kernel
from compd.model.kernels.linear import all_finite
from compd.model.solve_status import Reason

OK = int(Reason.OK)
NOT_FINITE = int(Reason.NOT_FINITE)


@kernel([MATRIX, VECTOR, VECTOR, INTEGERS], "(n,k),(k)->(n),()")
def joint_shortening(
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


def link_length_mm(zero_length_mm: FloatArray, scale_mm: FloatArray, joint_shortening_mm: FloatArray) -> FloatArray:
    """Equation (1): l_i = l0_i + gL_i - gB_i - gS_i, (..., n), in mm.

    zero_length_mm : (n,), l0, at machine zero.  scale_mm : (..., n), gL.  joint_shortening_mm : (..., n), gB + gS.
    nan in, nan out.
    """
    return zero_length_mm + scale_mm - joint_shortening_mm


def scale_for_length_mm(
    zero_length_mm: FloatArray, length_mm: FloatArray, joint_shortening_mm: FloatArray
) -> FloatArray:
    """Equation (1) solved for gL, (..., n), in mm: what the scales show when the links have these lengths.

    zero_length_mm : (n,).  length_mm : (..., n).  joint_shortening_mm : (..., n), gB + gS.  nan in, nan out.
    """
    return length_mm - zero_length_mm + joint_shortening_mm
