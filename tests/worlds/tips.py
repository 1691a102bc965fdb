"""Where the tip is, by a setpoint and in truth."""

from __future__ import annotations

import numpy as np

from compd.live.loop import Setpoint
from compd.setpoint_states import Mode
from compd.simulation import World as Truth

# Causes of a correction that gauges measure; all others are effects of the applied model.
GAUGED = ("joints", "frame")


def true_tip_mm(setpoint: Setpoint, truth: Truth) -> np.ndarray:
    """Where the tip is; in machine-tool mode where it were if the scales were at their setpoints.

    An adopted model describes effects that the truth lacks. They are taken to be real: links that are longer by an
    effect have the tip that scales without it have elsewhere.
    """
    values = setpoint.values
    assert values is not None
    by_effects_mm = sum(mm for cause, mm in values.contributions.items() if cause not in GAUGED)
    if setpoint.mode is Mode.MACHINE_TOOL:
        return truth.tip_for((values.scale_setpoint_mm - by_effects_mm).tolist())
    if setpoint.model:
        return truth.tip_for((np.array(truth._motion.position_mm) - by_effects_mm).tolist())
    state = truth.look()
    return state.tip_M if truth.tip_frame == "M" else state.tip_P


def tip_mm(setpoint: Setpoint, frame: str) -> np.ndarray:
    """Where a valid setpoint says that the tip is, in {M} or {P}."""
    values = setpoint.values
    assert values is not None
    return np.asarray(values.tip_M_mm if frame == "M" else values.tip_P_mm)
