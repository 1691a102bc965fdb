"""Motion of the machine during the absence of one length gauge, from the other ones."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from compd.live.memory import Doubt, TrustMemory

# Wait (s) for the missing gauges after an absence of all; then those that are back are compared alone.
WAIT_FOR_OTHERS_S = 2.0


class MotionWhileAway(NamedTuple):
    """What other channels say of an absence.

    moved : number of a channel that has moved; None where none has. compared : whether enough have been read again.
    witnessed : whether a scale that has kept its power was among them, or is the channel itself.
    """

    moved: int | None
    compared: bool
    witnessed: bool = True


def moved_while_away(memory: TrustMemory, i: int, back_s: float, now_s: float) -> MotionWhileAway:
    """Whether the machine has moved since channel `i` was last believed.

    What counts are the channels that have been good all the time, as far as they have been read since `i` was lost, and
    a scale among them: joints and frame hardly see the machine move. Where there is none, because everything was off,
    half of those that are back are enough to say that the machine has stood still, if a scale has kept its power.
    back_s : since when `i` answers.
    """
    n = memory.lengths
    witness = memory.witness[i]
    tolerance = memory.tolerance_mm[:n]
    known = (np.arange(n) != i) & ~np.isnan(witness)
    good = known & memory.undoubted[:n]
    stayed = good & (memory.time_s[:n] > memory.lost_s[i])
    back = known & (memory.shown_s[:n] > memory.lost_s[i])
    waited = now_s - back_s >= WAIT_FOR_OTHERS_S
    scales = np.arange(n) < memory.scales
    sees_motion = bool(stayed[scales].any()) or not memory.scales
    if sees_motion and (waited or (stayed == good).all()):
        moved = stayed & (np.abs(memory.value[:n] - witness) > tolerance)
        return MotionWhileAway(_first(moved), True)
    if not waited and back.sum() < known.sum():
        return MotionWhileAway(None, False)
    moved = back & (np.abs(memory.shown[:n] - witness) > tolerance)
    most = 2 * moved.sum() > back.sum()
    back[i] = True
    witnessed = bool((back & scales & (memory.power_lost[:n] == 0.0)).any()) or not memory.scales
    return MotionWhileAway(_first(moved) if most else None, True, witnessed)


def _first(channels: npt.NDArray[np.bool_]) -> int | None:
    return int(np.flatnonzero(channels)[0]) if channels.any() else None


def stood_still(memory: TrustMemory, i: int, since_s: float) -> bool | None:
    """Whether every scale beside `i` still shows what it showed when `i` was last believed.

    None if one of them has not been read since `since_s` (s). False if there is none.
    """
    n, before = memory.lengths, memory.witness[i]
    others = (np.arange(n) < memory.scales) & (np.arange(n) != i) & memory.undoubted[:n] & ~np.isnan(before)
    if (memory.shown_s[:n] < since_s)[others].any():
        return None
    return bool(others.any() and (np.abs(memory.shown[:n] - before) <= memory.tolerance_mm[:n])[others].all())


def scales_stood(memory: TrustMemory, i: int) -> bool:
    """Whether every believed scale has kept its value since `i` was last believed; False without a believed scale."""
    compared = 0
    for scale in range(memory.scales):
        if memory.doubt_of(scale) is not Doubt.NONE or math.isnan(before := memory.witness[i, scale]):
            continue
        if abs(memory.value[scale] - before) > memory.tolerance_mm[scale]:
            return False
        compared += 1
    return compared > 0
