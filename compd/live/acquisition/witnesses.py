"""What the other length gauges say of the time in which one of them was not read: has the machine moved meanwhile?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compd.live.memory.trust_memory import Doubt, TrustMemory

# Where all gauges were away, s, until those that are back are compared without those that are not.
_WAIT_FOR_OTHERS_S = 2.0


def moved_while_away(memory: TrustMemory, i: int, back_s: float, now_s: float) -> tuple[int | None, bool]:
    """Number of a channel that has moved since channel `i` was lost, and whether enough could be compared.

    What counts are the channels that have been good all the time. Where there are none, because everything was off,
    half of those that are back are enough to say that the machine has stood still. back_s : since when `i` answers.
    """
    n = memory.lengths
    others = np.arange(n) != i
    witness = memory.witness[i]
    tolerance = memory.tolerance_mm[:n]
    lost_s = float(memory.lost_s[i])
    stayed = others & (memory.doubt[:n] == Doubt.NONE) & ~np.isnan(witness)
    if stayed.any():
        moved = stayed & (np.abs(memory.value[:n] - witness) > tolerance)
        return (int(np.flatnonzero(moved)[0]) if moved.any() else None), True
    known = others & ~np.isnan(witness)
    back = known & (memory.shown_s[:n] > lost_s)
    if back.sum() < known.sum() and now_s - back_s < _WAIT_FOR_OTHERS_S:
        return None, False
    moved = back & (np.abs(memory.shown[:n] - witness) > tolerance)
    if 2 * moved.sum() > back.sum():
        return int(np.flatnonzero(moved)[0]), True
    return None, True


def stood_still(memory: TrustMemory, i: int, before: NDArray[np.float64]) -> bool:
    """Whether every channel beside `i` that can be compared shows what it showed before; False where there is none.

    before : values of all channels then, shape (n,), mm; nan where not known.
    """
    n = memory.lengths
    compared = (np.arange(n) != i) & (memory.doubt[:n] == Doubt.NONE) & ~np.isnan(before)
    return bool(
        compared.any() and (np.abs(memory.value[:n] - before)[compared] <= memory.tolerance_mm[:n][compared]).all()
    )
