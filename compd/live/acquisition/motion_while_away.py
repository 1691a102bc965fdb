"""Motion of the machine during the absence of one length gauge, from the other ones."""

from __future__ import annotations

import math

import numpy as np

from compd.live.memory import Doubt, TrustMemory

# Wait (s) for the missing gauges after an absence of all; then those that are back are compared alone.
_WAIT_FOR_OTHERS_S = 2.0


def moved_while_away(memory: TrustMemory, i: int, back_s: float, now_s: float) -> tuple[int | None, bool]:
    """Number of a channel that has moved since channel `i` was last believed, and whether enough were compared.

    What counts are the channels that have been good all the time, as far as they have been read since `i` was lost.
    Where there are none, because everything was off, half of those that are back are enough to say that the machine
    has stood still. back_s : since when `i` answers.
    """
    n = memory.lengths
    witness = memory.witness[i]
    tolerance = memory.tolerance_mm[:n]
    known = (np.arange(n) != i) & ~np.isnan(witness)
    good = known & (memory.doubt[:n] == Doubt.NONE)
    stayed = good & (memory.time_s[:n] > memory.lost_s[i])
    back = known & (memory.shown_s[:n] > memory.lost_s[i])
    waited = now_s - back_s >= _WAIT_FOR_OTHERS_S
    if stayed.any() and (waited or (stayed == good).all()):
        moved = stayed & (np.abs(memory.value[:n] - witness) > tolerance)
        return (int(np.flatnonzero(moved)[0]) if moved.any() else None), True
    if not waited and (good.any() or back.sum() < known.sum()):
        return None, False
    moved = back & (np.abs(memory.shown[:n] - witness) > tolerance)
    if 2 * moved.sum() > back.sum():
        return int(np.flatnonzero(moved)[0]), True
    return None, True


def stood_still(memory: TrustMemory, i: int) -> bool:
    """Whether every comparable channel beside `i` has kept its value since `i` was last believed.

    False if there is none.
    """
    n, before = memory.lengths, memory.witness[i]
    compared = (np.arange(n) != i) & (memory.doubt[:n] == Doubt.NONE) & ~np.isnan(before)
    return bool(
        compared.any() and (np.abs(memory.value[:n] - before)[compared] <= memory.tolerance_mm[:n][compared]).all()
    )


def scales_stood(memory: TrustMemory, i: int) -> bool:
    """Whether every believed scale has kept its value since `i` was last believed; False without a believed scale."""
    compared = 0
    for scale in range(memory.scales):
        if memory.doubt[scale] != Doubt.NONE or math.isnan(before := memory.witness[i, scale]):
            continue
        if abs(memory.value[scale] - before) > memory.tolerance_mm[scale]:
            return False
        compared += 1
    return compared > 0


def all_back(memory: TrustMemory, i: int, since_s: float) -> bool:
    """Whether every believed channel beside `i` has been read since a monotonic time (s)."""
    n = memory.lengths
    good = (np.arange(n) != i) & (memory.doubt[:n] == Doubt.NONE) & ~np.isnan(memory.value[:n])
    return bool((memory.time_s[:n][good] >= since_s).all())
