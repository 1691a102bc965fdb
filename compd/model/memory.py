"""What follows slowly: temperatures behind their surroundings in time, friction behind its scale in distance.

Both take their state and give it back, so that N rows at once and row after row are the same.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.model.kernels.jit import SCALAR, VECTOR, kernel

State: TypeAlias = tuple[FloatArray, ...]


@kernel(
    [VECTOR, VECTOR, VECTOR, SCALAR, SCALAR, SCALAR, SCALAR, VECTOR, VECTOR, VECTOR, VECTOR],
    "(m),(m),(m),(),(),(),()->(m),(),(),()",
)
def _lag(
    time_s: FloatArray,
    value: FloatArray,
    start: FloatArray,
    tau_s: float,
    time_before_s: float,
    value_before: float,
    lagged_before: float,
    lagged: FloatArray,
    time_after_s: FloatArray,
    value_after: FloatArray,
    lagged_after: FloatArray,
) -> None:
    for k in range(time_s.shape[0]):
        if math.isnan(value[k]):
            lagged[k] = math.nan  # a missing value is not remembered: the next one bridges the gap
            continue
        steps = (time_s[k] - time_before_s) / tau_s
        if start[k] != 0.0 or math.isnan(time_before_s):
            lagged_before = value[k]
        elif steps > 0.0:
            left = math.exp(-steps)
            # exact where the input runs straight from one row to the next
            ramp = -math.expm1(-steps) / steps
            lagged_before = value[k] + (lagged_before - value_before) * left - (value[k] - value_before) * ramp
        time_before_s = time_s[k]
        value_before = value[k]
        lagged[k] = lagged_before
    time_after_s[0] = time_before_s
    value_after[0] = value_before
    lagged_after[0] = lagged_before


def lag(
    time_s: FloatArray, value: FloatArray, session_start: BoolArray, tau_s: float, state: State | None
) -> tuple[FloatArray, State]:
    """First-order lag, tau dy/dt = x - y, solved exactly between rows for an input that runs straight there.

    time_s (N,), value (N, n), session_start (N,): there y starts at x.
    Returns y (N, n) and the state after; nan where the value is nan, which leaves no trace in the state.
    """
    if state is None:
        state = (np.full(value.shape[1], np.nan),) * 3
    lagged, *after = _lag(time_s, value.T, session_start.astype(float), tau_s, *state)
    return lagged.T, tuple(after)


@kernel(
    [VECTOR, VECTOR, VECTOR, SCALAR, SCALAR, SCALAR, SCALAR, SCALAR, VECTOR, VECTOR, VECTOR],
    "(m),(m),(m),(),(),(),(),()->(m),(),()",
)
def _friction(
    position_mm: FloatArray,
    direction: FloatArray,
    start: FloatArray,
    distance_mm: float,
    rounded: float,
    least_mm: float,
    position_before_mm: float,
    strain_before: float,
    strain: FloatArray,
    position_after_mm: FloatArray,
    strain_after: FloatArray,
) -> None:
    for k in range(position_mm.shape[0]):
        if math.isnan(position_mm[k]):
            strain[k] = math.nan
            continue
        if start[k] != 0.0 or math.isnan(position_before_mm):
            strain_before = direction[k] if abs(direction[k]) == 1.0 else 0.0
        else:
            move_mm = position_mm[k] - position_before_mm
            if abs(direction[k]) == 1.0 and abs(move_mm) > least_mm:
                move_mm = direction[k] * abs(move_mm)
            if rounded < 0.5:
                strain_before = min(1.0, max(-1.0, strain_before + move_mm / distance_mm))
            elif move_mm != 0.0:
                end = math.copysign(1.0, move_mm)
                strain_before = end - (end - strain_before) * math.exp(-abs(move_mm) / distance_mm)
        position_before_mm = position_mm[k]
        strain[k] = strain_before
    position_after_mm[0] = position_before_mm
    strain_after[0] = strain_before


def friction(
    position_mm: FloatArray,
    direction: FloatArray,
    session_start: BoolArray,
    distance_mm: float,
    rounded: float,
    least_mm: float,
    state: State | None,
) -> tuple[FloatArray, State]:
    """How far dry friction has bent what it holds, -1..1, while it is dragged along.

    position_mm, direction (N, n): a session starts fully bent in its direction, at 0 where that is not +1 or -1.
    rounded : 0 for the stop operator (one spring: elastic up to `distance_mm` of travel, then sliding; Visintin,
    Differential Models of Hysteresis, 1994, chapter III), 1 for many springs that slide one after another, which
    `distance_mm` brings nearer to the end by a factor e (Dahl, A solid friction model, 1968).
    A move beyond least_mm counts in the direction of its end: approached from one side, a link may have
    gone farther than the two rows tell.
    Returns (N, n) and the state after.
    """
    if state is None:
        state = (np.full(position_mm.shape[1], np.nan),) * 2
    started = session_start.astype(float)
    strain, *after = _friction(position_mm.T, direction.T, started, distance_mm, rounded, least_mm, *state)
    return strain.T, tuple(after)
