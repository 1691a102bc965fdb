"""A model's effects at work beside its kinematics: what they see, what they remember, and the machine that they make.

One definition for a single snapshot and for N of them: a row's memory is what the rows before it left behind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from compd.arrays import FloatArray
from compd.model.effect import Deltas, Memories, deltas_by_effect
from compd.model.frame import Frame
from compd.model.kinematics import Mechanism, Pose
from compd.model.machine import MachineModel
from compd.model.motion import Motion, Movement, update_motion
from compd.model.observations import Observations
from compd.model.observe import observe_at_pose
from compd.model.prediction import PerturbedMachine, perturb_machine

_Parts = TypeVar("_Parts", Frame, Pose, Mechanism)
_NOTHING: Memories = {}


class EffectMemory(NamedTuple):
    """What effects hand from one snapshot to the next; nothing in it is ever changed in place.

    motion : of the links, where an effect asks for it; None before the first snapshot.
    memories : by effect id.
    commanded : whether that motion is of commanded scales (machine-tool mode) and not of scales as read.
    """

    motion: Motion | None = None
    memories: Memories = _NOTHING
    commanded: bool = False


class EffectInputs(NamedTuple):
    """What there is to see in one snapshot, or in N of them.

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


def build_observations(
    model: MachineModel, sight: EffectInputs, before: EffectMemory, commanded: bool
) -> tuple[Observations, EffectMemory]:
    """The rows that effects see, N = 1 for a single snapshot; and the motion after them, memories as they were.

    commanded : the scales are where they shall be, not where they are.
    """
    assert model.constants is not None, "a model with effects has its constants"
    count = 1 if sight.scale_mm.ndim == 1 else len(sight.scale_mm)
    scale_mm, joint_mm, frame_mm = (_rows(part, count, 1) for part in (sight.scale_mm, sight.joint_mm, sight.frame_mm))
    time_s = _rows(np.asarray(sight.time_s, dtype=np.float64), count, 0)
    motion = before.motion
    start = np.zeros(count, dtype=bool)
    start[0] = motion is None and not before.memories
    movement, motion = _movement(model, before, commanded, time_s, scale_mm, joint_mm)
    pose = sight.pose
    rows = observe_at_pose(
        model.constants,
        _rows(sight.frame.base_joints_M_mm, count, 2),
        pose._replace(
            origin_M_mm=_rows(pose.origin_M_mm, count, 1),
            rotation_M_P=_rows(pose.rotation_M_P, count, 2),
            link_length_mm=_rows(pose.link_length_mm, count, 1),
        ),
        _rows(sight.tip_M_mm, count, 1),
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=frame_mm,
        quantities={name: _rows(np.asarray(value), count, 0) for name, value in sight.quantities.items()},
        time_s=time_s,
        session_start=start,
        movement=movement,
    )
    return rows, EffectMemory(motion, before.memories, commanded)


def apply_effects(
    model: MachineModel, sight: EffectInputs, before: EffectMemory, commanded: bool
) -> tuple[PerturbedMachine, EffectMemory]:
    """The machine as the effects alter it, one after the other, and what they remember.

    Every array that an effect alters has one more axis in front, (K, ...): its k-th entry holds effects 0 to k.
    """
    rows, after = build_observations(model, sight, before, commanded)
    each, memories = deltas_by_effect(model.live_effects, rows, before.memories)
    added = cumulate_deltas(list(each.values()))
    if sight.scale_mm.ndim == 1:
        added = {port: values[:, 0] for port, values in added.items()}
    machine = perturb_machine(model, sight.joint_mm, sight.frame_mm, added, sight.frame)
    return machine, after._replace(memories=memories)


def carry_over(remembered: EffectMemory, old: MachineModel, new: MachineModel) -> EffectMemory:
    """What of it holds for another model: the motion, and what the very same effects left with the same constants."""
    before = {one.effect.id: one for one in old.live_effects}
    memories = {
        name: remembered.memories[name]
        for name, one in ((one.effect.id, one) for one in new.live_effects)
        if name in remembered.memories and before[name].effect is one.effect and before[name].constants == one.constants
    }
    return remembered._replace(memories=memories)


def final(each: _Parts, like: _Parts) -> _Parts:
    """What `act` has altered, with all effects: `with_all` for every array; `like` is the same without effects."""
    return type(like)._make(map(final_array, each, like))


def final_array(each: NDArray[Any], like: NDArray[Any]) -> NDArray[Any]:
    """The last entry where there is one for each effect: one axis more than `like` has."""
    return each[-1] if each.ndim > like.ndim else each


def cumulate_deltas(each: Sequence[Deltas]) -> Deltas:
    """(K, N, size) per port: what the first k + 1 of K effects add together."""
    found: Deltas = {}
    for k, one in enumerate(each):
        for port, values in one.items():
            if port not in found:
                found[port] = np.zeros((len(each), *values.shape))
            found[port][k:] += values
    return found


def _rows(part: FloatArray, count: int, core: int) -> FloatArray:
    """(count, ...) of what has `core` axes of its own, or rows of them. Cheap for one row, as the live loop has."""
    if count == 1:
        return part if part.ndim > core else part[None]
    return np.broadcast_to(part, (count, *part.shape[part.ndim - core :]))


def _movement(
    model: MachineModel,
    before: EffectMemory,
    commanded: bool,
    time_s: FloatArray,
    scale_mm: FloatArray,
    joint_mm: FloatArray,
) -> tuple[Movement, Motion | None]:
    """How the links move at each row, and the motion after the last; unknown where no effect asks."""
    if not model.needs_motion:
        unknown = np.full(scale_mm.shape, np.nan)
        return Movement(np.zeros(scale_mm.shape), unknown, np.full(joint_mm.shape, np.nan)), None
    motion = before.motion
    if motion is not None and before.commanded != commanded:
        # a command is not where the scale stands: going over from one to the other is no motion
        motion = motion._replace(scale_mm=scale_mm[0], turning_mm=scale_mm[0])
    found = []
    for k, time in enumerate(time_s.tolist()):
        if motion is None or (np.isfinite(scale_mm[k]).all() and np.isfinite(joint_mm[k]).all()):
            motion = update_motion(motion, time, scale_mm[k], joint_mm[k])
        found.append(motion)
    return Movement(
        np.array([one.direction for one in found]),
        np.array([one.velocity_mm_per_s for one in found]),
        np.array([one.joint_velocity_mm_per_s for one in found]),
    ), motion
