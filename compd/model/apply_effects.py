"""Applying a model's effects: the machine with everything that they add at its ports, and what they remember.

One definition serves a single snapshot and N rows of them: a row's memory is what the rows before it left behind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from compd.arrays import FloatArray
from compd.model.deltas import Deltas, Memories, deltas_by_effect
from compd.model.frame import Frame
from compd.model.kinematics import Mechanism, Pose
from compd.model.machine import MachineModel
from compd.model.motion import Motion, Movement, track_motion
from compd.model.observations import Observations
from compd.model.observe import observe_at_pose
from compd.model.prediction import PerturbedMachine, perturb_machine

_Parts = TypeVar("_Parts", Frame, Pose, Mechanism)
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


class EffectInputs(NamedTuple):
    """What effects are computed from in one snapshot, or in N of them.

    scale_mm (..., n), joint_mm (..., k), frame_mm (..., 9): changes since machine zero.  quantities : (...) each.
    time_s (...): monotonic.  frame, pose, tip_M_mm (..., 3): by the kinematics alone.
    """

    scale_mm: FloatArray
    joint_mm: FloatArray
    frame_mm: FloatArray
    quantities: Mapping[str, FloatArray]
    time_s: FloatArray | float
    frame: Frame
    pose: Pose
    tip_M_mm: FloatArray


def apply_effects(
    model: MachineModel, inputs: EffectInputs, memory: EffectMemory, commanded: bool
) -> tuple[PerturbedMachine, EffectMemory]:
    """The machine with its K live effects added one after the other, and what they remember.

    Every array that an effect changes has one more axis in front, (K, ...): entry k holds effects 0 to k together, so
    that the last entry is the whole machine (`final`) and the differences are the effects' shares.
    commanded : the scales are where they are to be, not where they are.
    """
    rows, memory_after = build_observations(model, inputs, memory, commanded)
    by_effect, memories = deltas_by_effect(model.live_effects, rows, memory.memories)
    cumulative = cumulate_deltas(list(by_effect.values()))
    if inputs.scale_mm.ndim == 1:
        cumulative = {port: values[:, 0] for port, values in cumulative.items()}
    machine = perturb_machine(model, inputs.joint_mm, inputs.frame_mm, cumulative, inputs.frame)
    return machine, memory_after._replace(memories=memories)


def build_observations(
    model: MachineModel, inputs: EffectInputs, memory: EffectMemory, commanded: bool
) -> tuple[Observations, EffectMemory]:
    """The rows from which effects are computed, N = 1 for a single snapshot; and the memory with the motion after them.

    The effects' own memories are as they were; `apply_effects` replaces them.
    """
    assert model.constants is not None, "a model with effects has its constants"
    count = 1 if inputs.scale_mm.ndim == 1 else len(inputs.scale_mm)
    scale_mm, joint_mm, frame_mm = (
        _as_rows(readings, count, 1) for readings in (inputs.scale_mm, inputs.joint_mm, inputs.frame_mm)
    )
    time_s = _as_rows(np.asarray(inputs.time_s, dtype=np.float64), count, 0)
    session_start = np.zeros(count, dtype=bool)
    session_start[0] = memory.motion is None and not memory.memories
    movement, motion = _track_motion(model, memory, commanded, time_s, scale_mm, joint_mm)
    pose = inputs.pose
    rows = observe_at_pose(
        model.constants,
        _as_rows(inputs.frame.base_joints_M_mm, count, 2),
        pose._replace(
            origin_M_mm=_as_rows(pose.origin_M_mm, count, 1),
            rotation_M_P=_as_rows(pose.rotation_M_P, count, 2),
            link_length_mm=_as_rows(pose.link_length_mm, count, 1),
        ),
        _as_rows(inputs.tip_M_mm, count, 1),
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=frame_mm,
        quantities={name: _as_rows(np.asarray(value), count, 0) for name, value in inputs.quantities.items()},
        time_s=time_s,
        session_start=session_start,
        movement=movement,
    )
    return rows, EffectMemory(motion, memory.memories, commanded)


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


def final(cumulative: _Parts, nominal: _Parts) -> _Parts:
    """The parts with all effects, from those that `apply_effects` gives; `nominal` is the same without effects."""
    return type(nominal)._make(map(final_array, cumulative, nominal))


def final_array(cumulative: NDArray[Any], nominal: NDArray[Any]) -> NDArray[Any]:
    """The entry with all effects of (K, ...); the array itself where no effect changes it, as the axes tell."""
    return cumulative[-1] if cumulative.ndim > nominal.ndim else cumulative


def cumulate_deltas(by_effect: Sequence[Deltas]) -> Deltas:
    """(K, N, size) per port: what the first k + 1 of K effects add together."""
    cumulative: Deltas = {}
    for k, deltas in enumerate(by_effect):
        for port, values in deltas.items():
            if port not in cumulative:
                cumulative[port] = np.zeros((len(by_effect), *values.shape))
            cumulative[port][k:] += values
    return cumulative


def _as_rows(values: FloatArray, count: int, core: int) -> FloatArray:
    """(count, ...) of an array whose single row has `core` axes, or of rows of it; a single row is not broadcast."""
    if count == 1:
        return values if values.ndim > core else values[None]
    return np.broadcast_to(values, (count, *values.shape[values.ndim - core :]))


def _track_motion(
    model: MachineModel,
    memory: EffectMemory,
    commanded: bool,
    time_s: FloatArray,
    scale_mm: FloatArray,
    joint_mm: FloatArray,
) -> tuple[Movement, Motion | None]:
    """How the links move in each row, and the motion after the last; unknown where no effect depends on it."""
    if not model.needs_motion:
        return Movement.unknown(scale_mm, joint_mm), None
    motion = memory.motion
    if motion is not None and memory.commanded != commanded:
        # a scale does not stand where it is commanded: changing from one mode to the other is no motion
        motion = motion._replace(scale_mm=scale_mm[0], turning_mm=scale_mm[0])
    return track_motion(motion, time_s, scale_mm, joint_mm)
