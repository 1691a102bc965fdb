"""From gauge values and a model to a compensated tip and a scale setpoint: pure functions, shared by daemon and replay.

Both modes go the same way: machine frame (3), joints (1), kinematics, and then the effects of the model
(`effect_program`), if it has any. In both, the correction is what is added to the command, and the command
is what a controller that knows nothing of joints and frame would send to bring the tip to its target.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compd.arrays import FloatArray
from compd.compensation.external import compensate_external
from compd.compensation.rows import Rows, kernel_rows
from compd.compensation.values import Compensation, Contributions, GaugeValues, Wanted, WarmStart
from compd.errors import KinematicsError
from compd.model import EffectInputs, EffectMemory, MachineModel, PackedMemory, python_effects
from compd.model.effects import Memory
from compd.model.external import ExternalModel, given_pose
from compd.model.kernels import GivenRows, RowOptions, SolvedRows, compensate_rows
from compd.model.kinematics import Frame, Pose
from compd.model.structures import RESULT, WORKSPACE
from compd.rotation import compose, rotation_matrix

# In machine-tool mode effects are computed at the scale setpoint, which they shift themselves. After the first pass the
# error left is at most a scale's cyclic error, 1 % of its period; the second leaves 2 pi times 1 % of that: nanometres.
_EFFECT_PASSES = 2


def compensate_machine_tool(
    model: MachineModel,
    target_mm: ArrayLike,
    target_rotation_B0_rad: ArrayLike | None,
    values: GaugeValues,
    warm: WarmStart,
) -> tuple[Compensation, WarmStart]:
    """Machine-tool mode: equation (8), inverse kinematics with the base joints as they are now, (1) solved for gL.

    target_mm : (..., 3), in {B0}; with the tool on the plate the place on the work, in {P}.
    target_rotation_B0_rad : (..., 3), hexapod only, rotation vector of the attitude wanted for {P} in {B0}; None
        for machine zero's attitude.
    values : the scales are not used and may be nan; effects are computed at the setpoint.
    A row's reason says why it failed (NOT_FINITE, UNREACHABLE, NO_CONVERGENCE, NEAR_SINGULAR, OTHER_ASSEMBLY).
    Raises KinematicsError for an attitude asked of a tripod.
    """
    if isinstance(model, ExternalModel):
        at_pose = model
        if model.given is None:
            at_pose = model.with_pose(given_pose(target_mm, target_rotation_B0_rad, None, model.links))
        return compensate_external(at_pose, values, warm, commanded=True)
    attitude_M_P = _attitude(model, target_rotation_B0_rad, warm)
    contact = model.arrangement.target_contact(model.frame, target_mm)
    return _compensate(model, values, warm, Wanted(*contact, attitude_M_P))


def compensate_cmm(model: MachineModel, values: GaugeValues, warm: WarmStart) -> tuple[Compensation, WarmStart]:
    """CMM mode: equations (1) and (3), forward kinematics with the base joints as they are now, and (9).

    The correction is that of the command which the scales show now: its target is where uncompensated kinematics
    takes the tip to be.
    A row's reason says why it failed (NOT_FINITE, UNREACHABLE, NO_CONVERGENCE, NEAR_SINGULAR, OTHER_ASSEMBLY).
    """
    if isinstance(model, ExternalModel):
        return compensate_external(model, values, warm)
    return _compensate(model, values, warm, None)


def _compensate(
    model: MachineModel, values: GaugeValues, warm: WarmStart, wanted: Wanted | None
) -> tuple[Compensation, WarmStart]:
    """The compensation in machine-tool mode, or in CMM mode where nothing is wanted."""
    rows = kernel_rows(model, values, warm, wanted)
    memory, machine_tool = warm.effects, wanted is not None
    if not model.program.given:
        passes = _EFFECT_PASSES if machine_tool else 1
        solved = _solve(model, rows, memory, machine_tool, passes)
        return _result(model, rows, solved, memory, {}, machine_tool)
    # the kernel computes without effects, Python what its effects add there, and the kernel the whole
    without = replace(model, effects=())
    bare = _solve(without, rows, EffectMemory(), machine_tool, 1)
    effects_at_mm = (
        bare.results["scale_setpoint_mm"][:, : model.scales].copy() if machine_tool else rows.gauges.scale_mm
    )
    for _ in range(_EFFECT_PASSES if machine_tool else 1):
        inputs = _effect_inputs(model, rows, bare.results, values, effects_at_mm)
        given_mm, memories = python_effects(model, inputs, memory, machine_tool)
        solved = _solve(model, rows, memory, machine_tool, 1, GivenRows(effects_at_mm, given_mm))
        effects_at_mm = solved.results["scale_setpoint_mm"][:, : model.scales].copy()
    return _result(model, rows, solved, memory, memories, machine_tool)


class _Solved(NamedTuple):
    """What the kernel leaves: results (N,), contributions_mm (N, 2 + K, m), and the memory after the last row."""

    results: NDArray[np.void]
    contributions_mm: FloatArray
    memory: PackedMemory


def _solve(
    model: MachineModel,
    rows: Rows,
    memory: EffectMemory,
    machine_tool: bool,
    passes: int,
    given: GivenRows | None = None,
) -> _Solved:
    program = model.program
    count, scales = rows.gauges.scale_mm.shape
    solved = _Solved(
        _uninitialised(count, RESULT),
        np.empty((count, 2 + len(program.arrays.effects), scales)),
        memory.pack(model, rows.gauges.joint_mm.shape[1]),
    )
    compensate_rows(
        RowOptions(machine_tool, passes, memory.is_empty, memory.commanded != machine_tool),
        model.structure,
        program.arrays,
        rows.gauges,
        rows.quantities,
        rows.wanted,
        given or _nothing_given(count, scales, program.size),
        rows.warm,
        solved.memory.arrays,
        SolvedRows(_uninitialised(1, WORKSPACE), solved.results),
        solved.contributions_mm,
    )
    return solved


@lru_cache(maxsize=8)
def _nothing_given(count: int, scales: int, size: int) -> GivenRows:
    return GivenRows(np.full((count, scales), np.nan), np.empty((0, 0, size)))


def _uninitialised(count: int, structure: np.dtype[np.void]) -> NDArray[np.void]:
    """`count` uninitialised structures; `np.empty` takes 5 us for nested ones."""
    return np.ndarray(count, structure, np.empty(count * structure.itemsize, dtype=np.uint8))


def _effect_inputs(
    model: MachineModel, rows: Rows, bare: NDArray[np.void], values: GaugeValues, effects_at_mm: FloatArray
) -> EffectInputs:
    """What Python effects are computed from: the machine without effects."""
    n, pose = model.links, bare["bare_pose"]
    count = len(bare)
    return EffectInputs(
        rows.gauges._replace(scale_mm=effects_at_mm),
        {
            name: np.broadcast_to(quantity, rows.lead or (1,)).reshape(count)
            for name, quantity in values.quantities.items()
        },
        values.quantities_at_zero,
        pose["base_joints_M_mm"][:, :n],
        Pose(
            pose["origin_M_mm"],
            pose["rotation_M_P"],
            pose["link_length_mm"][:, :n],
            pose["iterations"][:, 0],
            pose["residual_mm"][:, 0],
            pose["reason"][:, 0],
        ),
        bare["tip_M_mm"],
    )


def _result(
    model: MachineModel,
    rows: Rows,
    solved: _Solved,
    memory: EffectMemory,
    memories: Mapping[str, Memory],
    machine_tool: bool,
) -> tuple[Compensation, WarmStart]:
    """The compensation and the next warm start. memories : of the Python effects."""
    n, m, lead = model.links, model.scales, rows.lead
    results: Any = solved.results.reshape(lead) if lead else solved.results[0]
    contributions_mm = (
        solved.contributions_mm.reshape(*lead, *solved.contributions_mm.shape[1:])
        if lead
        else solved.contributions_mm[0]
    )
    frame, pose = results["frame"], results["pose"]
    compensation = Compensation(
        results["tip_M_mm"],
        results["tip_B0_mm"],
        results["tip_P_mm"],
        pose["rotation_M_P"],
        Frame(
            frame["supports_M_mm"],
            frame["origin_M_mm"],
            frame["rotation_M_B"],
            frame["base_joints_M_mm"][..., :n, :],
            frame["displacement_M_mm"],
            frame["rotation_M_rad"],
            frame["iterations"][..., 0],
            frame["residual_mm"][..., 0],
            frame["reason"][..., 0],
        ),
        pose["link_length_mm"][..., :n],
        results["target_B_mm"],
        results["nominal_scale_mm"][..., :m],
        results["scale_setpoint_mm"][..., :m],
        results["correction_mm"][..., :m],
        Contributions(model.contribution_names, np.moveaxis(contributions_mm, -2, 0) if lead else contributions_mm),
        results["reason"],
    )
    if model.live_effects:
        memory = EffectMemory(commanded=machine_tool, packed=solved.memory)
        if memories:
            memory = EffectMemory(memory.motion, {**memory.memories, **memories}, machine_tool)
    warm = WarmStart(
        results["warm_supports_M_mm"],
        results["warm_origin_M_mm"],
        results["warm_rotation_M_P"],
        memory,
        results["warm_actuator_mm"][..., :m],
    )
    return compensation, warm


def _attitude(model: MachineModel, target_rotation_B0_rad: ArrayLike | None, warm: WarmStart) -> FloatArray:
    """The attitude wanted of a hexapod in {M}; for a tripod the guess to start from."""
    if not model.attitude_is_free:
        if target_rotation_B0_rad is not None:
            raise KinematicsError.of(
                "target",
                "a tripod's attitude follows from its tip",
                value=str(target_rotation_B0_rad),
                allowed="a position alone",
                next_step="leave the attitude out",
            )
        return warm.rotation_M_P
    if target_rotation_B0_rad is None:
        return model.zero.rotation_M_P
    return np.asarray(compose(model.frame.zero_rotation_M_B, rotation_matrix(target_rotation_B0_rad)))
