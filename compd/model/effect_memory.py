"""What effects hand from one snapshot to the next."""

from __future__ import annotations

from typing import NamedTuple

from compd.model.deltas import Memories
from compd.model.machine import MachineModel
from compd.model.motion import Motion

_NO_MEMORIES: Memories = {}


class EffectMemory(NamedTuple):
    """What effects hand from one snapshot to the next; nothing in it is ever changed in place.

    motion : of the links, where an effect depends on it; None before the first snapshot.
    memories : by effect id.
    commanded : whether that motion is of commanded scales (machine-tool mode) and not of scales as read.
    """

    motion: Motion | None = None
    memories: Memories = _NO_MEMORIES
    commanded: bool = False

    @property
    def is_empty(self) -> bool:
        """Whether no snapshot was before."""
        return self.motion is None and not self.memories


def carry_over(memory: EffectMemory, old: MachineModel, new: MachineModel) -> EffectMemory:
    """What of a memory is valid for another model: the motion, and the memories of effects that are the same in both,
    with the same constants."""
    before = {fitted.effect.id: fitted for fitted in old.live_effects}
    memories = {
        fitted.effect.id: memory.memories[fitted.effect.id]
        for fitted in new.live_effects
        if fitted.effect.id in memory.memories
        and before[fitted.effect.id].effect is fitted.effect
        and before[fitted.effect.id].constants == fitted.constants
    }
    return memory._replace(memories=memories)
