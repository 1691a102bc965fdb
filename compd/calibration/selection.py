"""Which blocks of numbers a calibration needs: those without which held-out poses are predicted worse."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray
from compd.calibration.criteria import CalibrationCriteria
from compd.calibration.held_out import Fold, HeldOut, held_out
from compd.calibration.machine_fit import MachineFit


class Selection(NamedTuple):
    """needed : blocks by their place.  without, with_it : (B) held-out errors without and with a block, all others as
    when it was judged.  dropped : in the order in which they went."""

    needed: tuple[int, ...]
    without: tuple[HeldOut, ...]
    with_it: tuple[HeldOut, ...]
    dropped: tuple[int, ...]


def select_blocks(
    fit: MachineFit, parts: list[Fold], refused: frozenset[int] = frozenset(), said: Callable[[str], None] | None = None
) -> Selection:
    """Begins with all blocks but those refused; drops the one that held-out poses miss least, until they miss each."""
    block_of, blocks = fit.parameters.block_of, fit.parameters.blocks
    kept = [block for block in range(len(blocks)) if block not in refused]
    none = HeldOut(np.nan, np.nan)
    without, with_it, dropped = [none] * len(blocks), [none] * len(blocks), []

    def free(chosen: list[int]) -> BoolArray:
        return np.isin(block_of, chosen)

    now = held_out(fit, free(kept), parts)
    while kept:
        if said is not None:
            said(f"blocks that held-out poses need, of {len(kept)}")
        tried = {block: held_out(fit, free([b for b in kept if b != block]), parts) for block in kept}
        for block, error in tried.items():
            without[block], with_it[block] = error, now
        least = min(kept, key=lambda block: tried[block].score)
        if tried[least].score - now.score > CalibrationCriteria.least_fall:
            break
        kept.remove(least)
        dropped.append(least)
        now = tried[least]
    drawn = held_out(fit, free([]), parts)
    if kept and drawn.score - now.score <= CalibrationCriteria.least_fall:
        # together they do not do what each does beside the others
        dropped, kept, now = [*dropped, *kept], [], drawn
    for block in refused:
        without[block], with_it[block] = now, held_out(fit, free(sorted([*kept, block])), parts)
    return Selection(tuple(kept), tuple(without), tuple(with_it), tuple(dropped))
