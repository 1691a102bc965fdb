"""The readings of wires in one snapshot, carried on to its time, and how uncertain they are by their age.

A reading is as old as its gauge's turn on the line makes it, and each is differently old. Each is carried on by its own
speed (`compd.live.acquisition.motion_estimate`), which comes with it: so a replay has all that the cycle had. One of a
gauge that does not answer any more is not carried away: after two rounds or 0.15 s, or at the standstill to which it
braked, it stays where it is.

A reading without motion, whose horizon_s is nan, is of a gauge that is no length, or in a recording of a release up to
0.2.0.
"""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray

from compd.arrays import FloatArray, IntArray
from compd.live.memory.readings import OK_NUMBER, SLOTS
from compd.model.kernels.jit import FLAG, INDICES, NUMBERS, SCALAR, helper, loop

# A device samples up to so long after the request or the trigger has left, s; a reading has the earliest time possible.
SAMPLED_LATER_S = 1e-3


@helper
def _extrapolated(slot: Any, now_s: float) -> float:
    """The value of a length (mm) at the monotonic time `now_s` (s)."""
    speed = slot.speed_mm_per_s
    if math.isnan(slot.horizon_s) or speed == 0.0:
        return float(slot.value)
    age_s = now_s - slot.time_s
    carried_s = age_s if age_s < slot.horizon_s else slot.horizon_s
    braking = slot.braking_mm_per_s2 if speed > 0.0 else -slot.braking_mm_per_s2
    return float(slot.value + (speed - 0.5 * braking * carried_s) * carried_s)


@loop([SLOTS, INDICES, NUMBERS, NUMBERS, NUMBERS, SCALAR, FLAG, NUMBERS])
def read_values(
    slots: NDArray[Any],
    wired: IntArray,
    stale_after_s: FloatArray,
    sign: FloatArray,
    zero: FloatArray,
    now_s: float,
    extrapolate: bool,
    values: FloatArray,
) -> tuple[float, float, bool]:
    """Fill in `values` (k,), sign * (reading - zero) of the slots `wired` (k,).

    stale_after_s : (k,) age from which a reading must not be used.  extrapolate : carry each reading on to `now_s`.
    Returns the times of the oldest and the newest reading, inf and -inf without wires, and whether all can be used.
    """
    oldest_s, newest_s, usable = math.inf, -math.inf, True
    for i in range(len(wired)):
        slot = slots[wired[i]]
        value = _extrapolated(slot, now_s) if extrapolate else slot.value
        values[i] = (value - zero[i]) * sign[i]
        oldest_s, newest_s = min(oldest_s, slot.time_s), max(newest_s, slot.time_s)
        if slot.quality != OK_NUMBER or now_s - slot.time_s > stale_after_s[i]:
            usable = False
    return oldest_s, newest_s, usable


@loop([SLOTS, INDICES, NUMBERS])
def drifts_mm_per_s(slots: NDArray[Any], wired: IntArray, drifts: FloatArray) -> None:
    """Fill in how fast each length (k,) may move that is not read any more: its speed and the uncertainty of that.

    nan where it is not known; 0 for a reading without motion.
    """
    for i in range(len(wired)):
        slot = slots[wired[i]]
        drifts[i] = 0.0 if math.isnan(slot.horizon_s) else abs(slot.speed_mm_per_s) + slot.u_mm_per_s


@loop([SLOTS, INDICES, SCALAR, FLAG, NUMBERS])
def age_uncertainties_mm(
    slots: NDArray[Any], wired: IntArray, now_s: float, extrapolate: bool, uncertainties_mm: FloatArray
) -> None:
    """Fill in the standard uncertainty (k,) in mm of each length by the age of its reading.

    nan where its motion is not known yet; 0 for a reading without motion.
    extrapolate : whether readings are carried on, and not used as they were read.
    """
    for i in range(len(wired)):
        slot = slots[wired[i]]
        if math.isnan(slot.horizon_s):
            uncertainties_mm[i] = 0.0
            continue
        age_s = now_s - slot.time_s
        uncertainties_mm[i] = slot.u_mm_per_s * age_s
        if slot.speed_mm_per_s != 0.0:
            not_carried_s = max(age_s - slot.horizon_s, 0.0) if extrapolate else age_s
            uncertainties_mm[i] += abs(slot.speed_mm_per_s) * (SAMPLED_LATER_S + not_carried_s)
