"""Effects that are plain Python: what they add is computed outside the compensation's kernel, and given to it."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.model.deltas import effect_deltas
from compd.model.effect_memory import EffectMemory
from compd.model.effects import Memory, Observations, port_size
from compd.model.kernels import GaugeRows
from compd.model.kinematics import Movement, track_motion
from compd.model.machine import MachineModel
from compd.model.observer import EffectInputs, observe_at_pose


def python_effects(
    model: MachineModel, inputs: EffectInputs, memory: EffectMemory, commanded: bool
) -> tuple[FloatArray, dict[str, Memory]]:
    """What the model's plain Python effects add, (N, K, size of all live ports), and their memories after the rows.

    The K effects are all live ones; those with a kernel add nothing here.
    commanded : the scales are where they are to be, not where they are.
    """
    rows = _observations(model, inputs, memory, commanded)
    program = model.program
    arrays = program.arrays
    added = np.zeros((len(rows), len(arrays.effects), program.size))
    memories: dict[str, Memory] = {}
    for index in program.given:
        fitted, begin = model.live_effects[index], int(arrays.effects[index]["targets_begin"])
        deltas, memories[fitted.effect.id] = effect_deltas(fitted, rows, memory.memories.get(fitted.effect.id))
        for port, values in deltas.items():
            if values.shape[1] != (size := port_size(port, rows)):
                raise ValueError(f"effect {fitted.effect.id} adds {values.shape[1]} numbers at {port}, not {size}")
            end = begin + size
            added[:, index, arrays.targets[begin:end]] = values
            begin = end
    return added, memories


def _observations(model: MachineModel, inputs: EffectInputs, memory: EffectMemory, commanded: bool) -> Observations:
    assert model.constants is not None, "a model with effects has its constants"
    session_start = np.zeros(len(inputs.gauges.time_s), dtype=bool)
    session_start[0] = memory.is_empty
    return observe_at_pose(model.constants, inputs, session_start, _movement(model, inputs.gauges, memory, commanded))


def _movement(model: MachineModel, gauges: GaugeRows, memory: EffectMemory, commanded: bool) -> Movement:
    """How the links move in each row; unknown where no effect depends on it."""
    if not model.needs_motion:
        return Movement.unknown(gauges.scale_mm, gauges.joint_mm)
    motion = memory.motion
    if motion is not None and memory.commanded != commanded:
        # a scale does not stand where it is commanded: changing from one mode to the other is no motion
        motion = motion._replace(scale_mm=gauges.scale_mm[0], turning_mm=gauges.scale_mm[0])
    movement, _ = track_motion(motion, gauges.time_s, gauges.scale_mm, gauges.joint_mm)
    return movement
