"""Effects that are plain Python: what they add is computed outside the compensation's kernel, and given to it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.model.deltas import effect_deltas
from compd.model.effect_memory import EffectMemory
from compd.model.effects import Memory, Observations, port_size
from compd.model.kinematics import Movement, Pose, track_motion
from compd.model.machine import MachineModel
from compd.model.observer import observe_at_pose


class EffectInputs(NamedTuple):
    """What effects are computed from in N snapshots.

    scale_mm (N, n), joint_mm (N, k), frame_mm (N, 9): changes since machine zero.  quantities : (N,) each.
    quantities_at_zero : the same at machine zero.
    time_s (N,): monotonic.  base_joints_M_mm (N, n, 3), pose, tip_M_mm (N, 3): by the kinematics alone.
    """

    scale_mm: FloatArray
    joint_mm: FloatArray
    frame_mm: FloatArray
    quantities: Mapping[str, FloatArray]
    quantities_at_zero: Mapping[str, float]
    time_s: FloatArray
    base_joints_M_mm: FloatArray
    pose: Pose
    tip_M_mm: FloatArray


def python_effects(
    model: MachineModel, inputs: EffectInputs, memory: EffectMemory, commanded: bool
) -> tuple[FloatArray, dict[str, Memory]]:
    """What the model's plain Python effects add, (N, K, size of all live ports), and their memories after the rows.

    The K effects are all live ones; those with a kernel add nothing here.
    commanded : the scales are where they are to be, not where they are.
    """
    rows = _observations(model, inputs, memory, commanded)
    program = model.program
    added = np.zeros((len(rows), len(program.effects), program.size))
    memories: dict[str, Memory] = {}
    for place in program.given:
        fitted, begin = model.live_effects[place], int(program.effects[place]["targets_begin"])
        deltas, memories[fitted.effect.id] = effect_deltas(fitted, rows, memory.memories.get(fitted.effect.id))
        for port, values in deltas.items():
            if values.shape[1] != (size := port_size(port, rows)):
                raise ValueError(f"effect {fitted.effect.id} adds {values.shape[1]} numbers at {port}, not {size}")
            end = begin + size
            added[:, place, program.targets[begin:end]] = values
            begin = end
    return added, memories


def _observations(model: MachineModel, inputs: EffectInputs, memory: EffectMemory, commanded: bool) -> Observations:
    assert model.constants is not None, "a model with effects has its constants"
    session_start = np.zeros(len(inputs.time_s), dtype=bool)
    session_start[0] = memory.is_empty
    return observe_at_pose(
        model.constants,
        inputs.base_joints_M_mm,
        inputs.pose,
        inputs.tip_M_mm,
        scale_mm=inputs.scale_mm,
        joint_mm=inputs.joint_mm,
        frame_mm=inputs.frame_mm,
        quantities=inputs.quantities,
        time_s=inputs.time_s,
        session_start=session_start,
        movement=_movement(model, inputs, memory, commanded),
        quantities_at_zero=inputs.quantities_at_zero,
    )


def _movement(model: MachineModel, inputs: EffectInputs, memory: EffectMemory, commanded: bool) -> Movement:
    """How the links move in each row; unknown where no effect depends on it."""
    if not model.needs_motion:
        return Movement.unknown(inputs.scale_mm, inputs.joint_mm)
    motion = memory.motion
    if motion is not None and memory.commanded != commanded:
        # a scale does not stand where it is commanded: changing from one mode to the other is no motion
        motion = motion._replace(scale_mm=inputs.scale_mm[0], turning_mm=inputs.scale_mm[0])
    movement, _ = track_motion(motion, inputs.time_s, inputs.scale_mm, inputs.joint_mm)
    return movement
