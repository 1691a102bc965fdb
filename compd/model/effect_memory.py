"""What effects hand from one snapshot to the next."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

from compd.link_count import scale_count
from compd.model.deltas import Memories
from compd.model.effects import EffectProgram
from compd.model.kernels import MemoryArrays
from compd.model.kinematics import Motion, pack_motion, unpack_motion
from compd.model.machine import MachineModel

_NO_MEMORIES: Memories = {}


class PackedMemory(NamedTuple):
    """What the kernel of one program leaves; see `compd.model.kernels.motion` and `compd.model.effects.effect_program`.

    scales : m.
    """

    program: EffectProgram
    scales: int
    arrays: MemoryArrays


class EffectMemory:
    """What effects hand from one snapshot to the next; it is never changed in place.

    From one cycle to the next it stays packed, as the kernel left it.
    """

    def __init__(
        self,
        motion: Motion | None = None,
        memories: Memories = _NO_MEMORIES,
        commanded: bool = False,
        packed: PackedMemory | None = None,
    ) -> None:
        """`packed`: in the place of motion and memories."""
        #: whether that motion is of commanded scales (machine-tool mode) and not of scales as read
        self.commanded = commanded
        self._packed = packed
        if packed is None:
            self.motion = motion  #: of the links, where an effect depends on it; None before the first snapshot
            self.memories = memories  #: by effect id

    @cached_property
    def motion(self) -> Motion | None:
        assert self._packed is not None
        _, scales, (row, _) = self._packed
        return unpack_motion(row, scales, (len(row) - 1 - 4 * scales) // 2)

    @cached_property
    def memories(self) -> Memories:
        assert self._packed is not None
        return self._packed.program.unpack_memories(self._packed.arrays.memories)

    @property
    def is_empty(self) -> bool:
        """Whether no snapshot was before."""
        return self._packed is None and self.motion is None and not self.memories

    def pack(self, model: MachineModel, joints: int) -> PackedMemory:
        """A copy for the kernel of this machine with k joint comparators, which changes it."""
        program, scales = model.program, scale_count(model.links)
        if self._packed is not None and self._packed.program is program:
            kept = self._packed.arrays
            return PackedMemory(program, scales, MemoryArrays(kept.motion.copy(), kept.memories.copy()))
        motion = pack_motion(self.motion if model.needs_motion else None, scales, joints)
        return PackedMemory(program, scales, MemoryArrays(motion, program.pack_memories(self.memories)))

    def __reduce__(self) -> tuple[Any, ...]:
        return EffectMemory, (self.motion, self.memories, self.commanded)


def carry_over(memory: EffectMemory, old: MachineModel, new: MachineModel) -> EffectMemory:
    """What of a memory is valid for another model: the motion, and the memories of effects that are the same in both,
    with the same constants."""
    before = {fitted.effect.id: fitted for fitted in old.live_effects}
    memories = {
        fitted.effect.id: memory.memories[fitted.effect.id]
        for fitted in new.live_effects
        if fitted.effect.id in memory.memories
        and before[fitted.effect.id].effect == fitted.effect
        and before[fitted.effect.id].constants == fitted.constants
    }
    return EffectMemory(memory.motion, memories, memory.commanded)
