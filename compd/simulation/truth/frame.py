"""The machine frame: thermal expansion and bending of columns, ring and plate, and their elasticity."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.strengths import Strengths
from compd.simulation.truth.warm_up import COLUMN_STOREYS, WarmUp

# From a drawing of a machine of this size: columns 150 mm deep, standing as far below the plate's
# surface as the plate is thick.
COLUMN_DEPTH_MM = 150.0
FOOT_BELOW_PLATE_MM = 200.0
# Share of the columns' differences in lean that remains: the ring between them is stiff.
LEAN_KEPT_SHARE = 0.2
# The nine distances (paper, equation (3)): ends among b1 b2 b3 m1 m2 m3, in order t1 t2 t3 u1 .. u6.
DISTANCE_ENDS = ((0, 1), (1, 2), (2, 0), (0, 3), (0, 5), (1, 3), (1, 4), (2, 4), (2, 5))
_FROM, _TO = np.array(DISTANCE_ENDS).T
DISTANCES = ("t1", "t2", "t3", "u1", "u2", "u3", "u4", "u5", "u6")
# Distance of each storey's middle from the column's top, as a share of its height.
_BELOW_TOP = 1 - (np.arange(COLUMN_STOREYS) + 0.5) / COLUMN_STOREYS
PPM = 1e-6
UM = 1e-3


def distances_mm(supports_M: FloatArray, plate_M: FloatArray) -> FloatArray:
    """(9,) t1 t2 t3 u1 .. u6 between supports and plate points, (3, 3) each."""
    ends = np.concatenate([supports_M, plate_M])
    return np.asarray(np.linalg.norm(ends[_FROM] - ends[_TO], axis=1))


class Frame:
    """Positions of supports and plate points, and the nine frame comparators between them."""

    def __init__(self, mechanism: Mechanism, strengths: Strengths) -> None:
        self._mechanism = mechanism
        self._strengths = strengths
        supports = mechanism.supports0_M
        thickness = mechanism.geometry.plate_thickness_mm or FOOT_BELOW_PLATE_MM
        # Height above the columns' feet; negative for a support that hangs below them.
        self._heights_mm = supports[:, 2] + thickness
        self._arms_M = supports - supports.mean(axis=0)
        outward = self._arms_M * [1.0, 1.0, 0.0]
        length = np.linalg.norm(outward, axis=1, keepdims=True)
        self._outward_M = np.divide(outward, length, out=np.zeros_like(outward), where=length > 0)
        self._distances0_mm = distances_mm(supports, mechanism.plate0_M)
        across, along = strengths.column_give_across_um_per_N, strengths.column_give_along_um_per_N
        self._compliance_mm_per_N = np.array([across, across, along]) * UM

    def unloaded_M(self, warm: WarmUp) -> FloatArray:
        """(3, 3) mm: supports under the forces of machine zero. A frame of which nothing is described stands still."""
        if not self._mechanism.has_frame:
            return self._mechanism.supports0_M
        return self._mechanism.supports0_M + self._growth(warm) + self._lean(warm)

    def give_M(self, pull_M: FloatArray) -> FloatArray | float:
        """(3, 3) mm: elastic displacement of the supports; pull_M : (3, 3) N, force on each less that at zero."""
        return pull_M * self._compliance_mm_per_N if self._mechanism.has_frame else 0.0

    def plate_M(self, warm: WarmUp) -> FloatArray:
        """(3, 3) mm: plate points after expansion of the plate about its middle, the origin of {M}."""
        growth = self._strengths.plate_expansion_ppm_per_K * PPM * warm.plate_K.mean()
        return np.asarray(self._mechanism.plate0_M * [1 + growth, 1 + growth, 1.0])

    def comparators_mm(self, supports_M: FloatArray, plate_M: FloatArray, warm: WarmUp) -> FloatArray:
        """(9,) change of each distance since machine zero, less the rod's own expansion."""
        rods = self._strengths.frame_rod_expansion_ppm_per_K * PPM * warm.since_zero_K("rods")
        return np.asarray(distances_mm(supports_M, plate_M) - self._distances0_mm * (1 + rods))

    def _growth(self, warm: WarmUp) -> FloatArray:
        """(3, 3) mm: expansion of the ring about its middle and of the columns upwards."""
        ring = self._strengths.ring_expansion_ppm_per_K * PPM * warm.since_zero_K("base")
        column = self._strengths.column_expansion_ppm_per_K * PPM * warm.columns_K.mean(axis=(1, 2))
        growth_M: FloatArray = ring * self._arms_M
        growth_M[:, 2] += column * self._heights_mm
        return growth_M

    def _lean(self, warm: WarmUp) -> FloatArray:
        """(3, 3) mm: a warmer outer face bends its column inwards.

        curvature = alpha (T_outer - T_inner) / depth per storey, integrated twice up to the top.
        """
        inner_K, outer_K = warm.columns_K[:, 0, :], warm.columns_K[:, 1, :]
        curvature = self._strengths.column_expansion_ppm_per_K * PPM / COLUMN_DEPTH_MM * (outer_K - inner_K)
        inwards = (curvature * _BELOW_TOP).sum(axis=1) * self._heights_mm**2 / COLUMN_STOREYS
        lean_M = -inwards[:, None] * self._outward_M
        mean_M = lean_M.mean(axis=0)
        return np.asarray(mean_M + LEAN_KEPT_SHARE * (lean_M - mean_M))
