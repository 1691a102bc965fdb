"""The live effects of a machine model as data for the compensation's kernel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate, chain, pairwise
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.model.effects.effect import FittedEffect, Memory, Port
from compd.model.effects.effect_basis import machine_structure, port_sizes, program_numbers
from compd.model.effects.effect_needs import needed_quantities
from compd.model.effects.observations import MachineConstants
from compd.model.kernels import EffectArrays
from compd.model.structures import EFFECT, FRAME, GIVEN, LENGTHS, MACHINE, MECHANISM
from compd.reference_conditions import standard_value

# In the order in which the kernel has the ports' numbers behind one another.
LIVE_PORTS: tuple[Port, ...] = (
    "scale",
    "joint",
    "frame",
    "link",
    "base_joint",
    "platform_joint",
    "revolute_axis",
    "plate",
    "tool",
)
# What a port changes; those not named change the mechanism.
_LEVELS: Mapping[Port, int] = {"scale": LENGTHS, "joint": LENGTHS, "link": LENGTHS, "frame": FRAME, "plate": FRAME}


def port_numbers(links: int, joints: int, axes: int) -> dict[Port, range]:
    """The places of each port's numbers among those of all."""
    sizes = port_sizes(links, joints, axes)
    ends = accumulate((sizes[port] for port in LIVE_PORTS), initial=0)
    return {port: range(*each) for port, each in zip(LIVE_PORTS, pairwise(ends), strict=True)}


class EffectProgram(NamedTuple):
    """K effects of a machine as the kernel reads them."""

    arrays: EffectArrays  #: what the kernel takes
    quantities: tuple[str, ...]  #: names of all that are needed
    #: those from which effects count: each name of `quantities`, and its value; None where that is the one at machine
    #: zero
    references: tuple[tuple[str, float | None], ...]
    #: where each array of each effect's memory begins and ends, by the effect's id
    states: Mapping[str, tuple[tuple[int, int], ...]]
    size: int  #: of all ports together
    #: indices of the effects that are plain Python: what they add is computed outside the kernel
    given: tuple[int, ...]

    @property
    def needed_at_zero(self) -> frozenset[str]:
        """Names of the quantities whose values at machine zero are needed."""
        return frozenset(name for name, value in self.references if value is None)

    def pack_memories(self, memories: Mapping[str, Memory]) -> FloatArray:
        """The memories of all effects with a kernel, behind one another; nan for one that has none yet."""
        each = (_memory_or_unknown(memories.get(id_), states) for id_, states in self.states.items() if states)
        packed = list(chain.from_iterable(each))
        return np.concatenate(packed) if packed else np.zeros(0)

    def unpack_memories(self, packed: FloatArray) -> dict[str, Memory]:
        """The memories by effect, None for an effect without."""
        return {
            id_: tuple(packed[begin:end] for begin, end in states) if states else None
            for id_, states in self.states.items()
        }


def _memory_or_unknown(memory: Memory, states: Sequence[tuple[int, int]]) -> Sequence[FloatArray]:
    return [np.full(end - begin, np.nan) for begin, end in states] if memory is None else memory


def build_program(
    fitted: Sequence[FittedEffect], constants: MachineConstants | None, links: int, joints: int, axes: int
) -> EffectProgram:
    """The program of live effects on a machine with so many links, joint comparators and revolute axes."""
    sizes = port_sizes(links, joints, axes)
    numbers = port_numbers(links, joints, axes)
    all_needed = (name for each in fitted for name in needed_quantities(each.effect, links))
    quantities = {name: index for index, name in enumerate(dict.fromkeys(all_needed))}
    references: dict[tuple[str, float | None], int] = {}
    effects = np.zeros(len(fitted), dtype=EFFECT)
    parts: dict[str, list[Any]] = {"theta": [], "numbers": [], "code": [], "quantities": [], "memory": []}
    targets: list[int] = []
    states: dict[str, tuple[tuple[int, int], ...]] = {}
    for structure, each in zip(effects, fitted, strict=True):
        effect = each.effect
        structure["level"] = max(_LEVELS.get(port, MECHANISM) for port in effect.ports)
        structure["targets_begin"] = len(targets)
        targets += [number for port in effect.ports for number in numbers[port]]
        structure["size"] = len(targets) - structure["targets_begin"]
        own: dict[str, Any] = {"theta": each.theta, "numbers": [], "code": np.zeros((0, 2), dtype=np.int64)}
        own |= {"quantities": [], "memory": []}
        if callable(effect.basis):
            structure["number"] = GIVEN
            states[effect.id] = ()
        else:
            program = effect.basis.program(effect, links, sizes)
            structure["number"] = program.number
            own |= {"numbers": program_numbers(effect, program, each.constants), "code": program.code}
            own["memory"] = np.zeros(sum(program.states))
            ends = list(accumulate(program.states, initial=sum(map(len, parts["memory"]))))
            states[effect.id] = tuple(pairwise(ends))
        names = needed_quantities(effect, links)
        from_zero = effect.counts_from == "machine zero"
        own["quantities"] = [quantities[name] for name in names]
        own["quantities"] += [
            len(quantities)
            + references.setdefault((name, None if from_zero else standard_value(name)), len(references))
            for name in names
        ]
        for name, values in own.items():
            structure[f"{name}_begin"] = sum(map(len, parts[name]))
            structure[f"{name}_end"] = structure[f"{name}_begin"] + len(values)
            parts[name].append(values)
    return EffectProgram(
        EffectArrays(
            np.zeros(1, dtype=MACHINE) if constants is None else machine_structure(constants),
            effects,
            np.concatenate([*parts["theta"], np.zeros(0)]),
            np.concatenate([*parts["numbers"], np.zeros(0)]),
            np.concatenate([*parts["code"], np.zeros((0, 2), dtype=np.int64)]),
            np.array([index for own in parts["quantities"] for index in own], dtype=np.int64),
            np.array(targets, dtype=np.int64),
        ),
        tuple(quantities),
        tuple(references),
        states,
        numbers[LIVE_PORTS[-1]].stop,
        tuple(np.flatnonzero(effects["number"] == GIVEN).tolist()),
    )
