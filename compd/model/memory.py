"""Effects with memory: a first-order lag in time (temperatures) and dry friction along a distance.

Both take their state and return it, so that N rows at once and row after row give the same bits.
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
    """One column of `lag`; the state's three parts apart."""
    for k in range(time_s.shape[0]):
        if math.isnan(value[k]):
            lagged[k] = math.nan  # a missing value leaves the state as it is
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
    """First-order lag, tau dy/dt = x - y, solved exactly for an input x that is linear between rows.

    With s = (t1 - t0) / tau (Incropera, Fundamentals of Heat and Mass Transfer, chapter 5, for a step; integrated by
    parts for a ramp):

        y1 = x1 + (y0 - x0) exp(-s) - (x1 - x0) (1 - exp(-s)) / s

    time_s (N,), value (N, n) is x, session_start (N,): there y starts at x.  tau_s : above 0.
    state : (time, x, y), (n,) each, after the last row before; None at the start.
    Returns y (N, n) and the state after. A value that is nan gives nan and is left out: the next one follows on the
    last that was known.

    Example: an input that rises from 0 to 1 within tau leaves y = 1 - (1 - exp(-1)) = 0.368 at its end.
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
    """One column of `friction`; the state's two parts apart."""
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
    """Elastic deflection of what dry friction holds, as a share z of the deflection at which it slides, -1..1.

    For a move dx from one row to the next:

        rounded = 0, stop operator, one spring that slides at its limit (Visintin, Differential Models of Hysteresis,
            1994, chapter III):                      z1 = min(1, max(-1, z0 + dx / distance))
        rounded = 1, many springs that slide one after another (Dahl, A solid friction model, 1968), with s = sgn(dx):
                                                     z1 = s - (s - z0) exp(-|dx| / distance)

    position_mm, direction (N, n): a session starts at z = direction, at 0 where that is not +1 or -1.
    session_start (N,).  distance_mm : above 0.
    least_mm : a longer move counts in the direction of the row where it ends: a link that was approached from one
        side may have overshot between two rows.
    state : (position, z), (n,) each, after the last row before; None at the start.
    Returns z (N, n) and the state after; nan where the position is nan, which is left out of the state.

    Example, stop operator with a distance of 1 mm from rest: positions 0, 0.5, 1.5, 1.25 mm give z = 0, 0.5, 1, 0.75.
    """
    if state is None:
        state = (np.full(position_mm.shape[1], np.nan),) * 2
    started = session_start.astype(float)
    strain, *after = _friction(position_mm.T, direction.T, started, distance_mm, rounded, least_mm, *state)
    return strain.T, tuple(after)
