"""What effects remember, one step at a time: a first-order lag in time, and dry friction along a distance."""

from __future__ import annotations

import math

from compd.jit import helper


@helper
def lag_step(
    time_s: float,
    value: float,
    starts: bool,
    tau_s: float,
    time_before_s: float,
    value_before: float,
    lagged_before: float,
) -> float:
    """First-order lag, tau dy/dt = x - y, solved exactly for an input x that is linear between two rows.

    With s = (t1 - t0) / tau (Incropera, Fundamentals of Heat and Mass Transfer, chapter 5, for a step; integrated by
    parts for a ramp):

        y1 = x1 + (y0 - x0) exp(-s) - (x1 - x0) (1 - exp(-s)) / s

    value, value_before : x1 and x0.  lagged_before : y0.  starts : y starts at x; so it does where no row was before,
    time_before_s nan.  tau_s : above 0.

    Example: an input that rises from 0 to 1 within tau leaves y = 1 - (1 - exp(-1)) = 0.368 at its end.
    """
    if starts or math.isnan(time_before_s):
        return value
    steps = (time_s - time_before_s) / tau_s
    if not steps > 0.0:
        return lagged_before
    left = math.exp(-steps)
    # exact where the input runs straight from one row to the next
    ramp = -math.expm1(-steps) / steps
    return value + (lagged_before - value_before) * left - (value - value_before) * ramp


@helper
def friction_step(
    position_mm: float,
    direction: float,
    starts: bool,
    distance_mm: float,
    rounded: float,
    least_mm: float,
    position_before_mm: float,
    strain_before: float,
) -> float:
    """Elastic deflection of what dry friction holds, as a share z of the deflection at which it slides, -1..1.

    For a move dx from one row to the next:

        rounded = 0, stop operator, one spring that slides at its limit (Visintin, Differential Models of Hysteresis,
            1994, chapter III):                      z1 = min(1, max(-1, z0 + dx / distance))
        rounded = 1, many springs that slide one after another (Dahl, A solid friction model, 1968), with s = sgn(dx):
                                                     z1 = s - (s - z0) exp(-|dx| / distance)

    starts : a session starts at z = direction, at 0 where that is not +1 or -1; so it does where no row was before,
        position_before_mm nan.
    distance_mm : above 0.
    least_mm : a longer move counts in the direction of the row where it ends: a link that was approached from one
        side may have overshot between two rows.

    Example, stop operator with a distance of 1 mm from rest: positions 0, 0.5, 1.5, 1.25 mm give z = 0, 0.5, 1, 0.75.
    """
    if starts or math.isnan(position_before_mm):
        return direction if abs(direction) == 1.0 else 0.0
    move_mm = position_mm - position_before_mm
    if abs(direction) == 1.0 and abs(move_mm) > least_mm:
        move_mm = direction * abs(move_mm)
    if rounded < 0.5:
        return min(1.0, max(-1.0, strain_before + move_mm / distance_mm))
    if move_mm != 0.0:
        end = math.copysign(1.0, move_mm)
        return end - (end - strain_before) * math.exp(-abs(move_mm) / distance_mm)
    return strain_before
