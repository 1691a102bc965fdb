"""Causes in the tool: displacements of the tip against what carries the tool."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import PPM, UM, Cause, CauseInputs, unit_rms_scatter
from compd.simulation.truth.mechanism import Mechanism

# Share of the platform's temperature that the tool's stem takes, by conduction.
FROM_PLATFORM_SHARE = 0.15
# A probe's springs give alike in all directions, its stem only sideways: axial over lateral compliance.
AXIAL_SHARE = 0.9


class ToolExpansion(Cause):
    """Thermal expansion of the tool: the tip's place r grows by alpha r (T - its value at machine zero).

    T is the tool's temperature with 15 % of the platform's. Strength: alpha (tungsten carbide 5, steel 11 ppm/K).
    """

    id = "tool_expansion"
    unit = "ppm/K"
    max_strength = 25.0

    def tool_shift(self, inputs: CauseInputs) -> FloatArray:
        tool_K, clamp_K = (inputs.warm.since_zero_K(body) for body in ("tool", "platform"))
        mean_K = tool_K + FROM_PLATFORM_SHARE * (clamp_K - tool_K)
        tip = self.mechanism.tip0_P if self.mechanism.tip_frame == "M" else self.mechanism.tip0_M
        return np.asarray(self.strength * PPM * tip * mean_K)


class ToolOffset(Cause):
    """Constant displacement of the tip from the drawing; strength: root mean square of its three components."""

    id = "tool_offset"
    unit = "um"
    max_strength = 50.0
    signed = True

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.part_strengths = strength * unit_rms_scatter(rng, 3)

    def tool_shift(self, inputs: CauseInputs) -> FloatArray:
        return np.asarray(UM * self.part_strengths)


class ToolBending(Cause):
    """Elastic deflection of springs and stem under the load F on the tip: shift_P = c (F_x, F_y, 0.9 F_z) in {P}.

    With the tool on the plate the work's reaction bends it: shift_M = -c F. Strength: the compliance c.
    """

    id = "tool_bending"
    unit = "um/N"
    min_strength = 0.01
    max_strength = 1.0

    def tool_shift(self, inputs: CauseInputs) -> FloatArray:
        if self.mechanism.tip_frame == "P":
            return np.asarray(-self.strength * UM * inputs.force_M_N)
        force_P_N = inputs.posture[1:] @ inputs.force_M_N
        return np.asarray(self.strength * UM * force_P_N * [1.0, 1.0, AXIAL_SHARE])


CAUSES = (ToolExpansion, ToolOffset, ToolBending)
