"""By how much the tip of one snapshot moves with each of what its uncertainty comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.model.effect_memory import EffectMemory
from compd.model.effects import Observations, evaluate_basis
from compd.model.external import ExternalModel, external_tip_derivatives
from compd.model.kernels import GaugeRows, SolvedRows, TipDerivativeArrays, WarmRows, set_tip_derivatives
from compd.model.kinematics import Movement
from compd.model.machine import MachineModel
from compd.model.observer import observe
from compd.model.structures import RESULT, WORKSPACE


class TipDerivatives(NamedTuple):
    """Of the tip in {M}, with the tool on the plate of the touched place in {P}; nan where there is no pose.

    by_gauge : (3, m + k + f), mm per mm of scales, joint and frame comparators.
    by_theta : (3, P), mm per unit of each fitted number of the live effects.
    by_quantity : (3, q), mm for each quantity's standard deviation, in the order of the model's program.
    """

    by_gauge: FloatArray
    by_theta: FloatArray
    by_quantity: FloatArray


def tip_derivatives(
    model: MachineModel,
    *,
    scale_mm: FloatArray,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    quantities: Mapping[str, FloatArray],
    quantities_at_zero: Mapping[str, float],
    sigmas: Mapping[str, float],
    time_s: float,
    effects: EffectMemory,
) -> TipDerivatives:
    """Of one snapshot, at the pose without effects.

    scale_mm (m,), joint_mm (k,), frame_mm (9,), (6,) of u1..u6 alone, or (0,) : changes since
        machine zero.
    quantities : those that the effects need.
    quantities_at_zero : the same at machine zero.
    sigmas : standard deviation of each, in its own unit; nan for one that is not named.
    effects : what they remember after this snapshot.
    The noise of the scales also changes what an effect at the port `scale` adds; that is left out: at most a few per
    cent of the noise itself.
    """
    if isinstance(model, ExternalModel):
        return TipDerivatives(*external_tip_derivatives(model, scale_mm, quantities, sigmas, time_s, effects))
    program = model.program
    packed = effects.pack(model, len(joint_mm))
    values = np.array([quantities[name] for name in program.quantities], dtype=np.float64)
    references = [quantities_at_zero[name] if value is None else value for name, value in program.references]
    raised = values + np.array([sigmas.get(name, np.nan) for name in program.quantities], dtype=np.float64)
    zero = model.zero
    arrays = TipDerivativeArrays(
        np.empty((3, program.size)), np.empty((3, len(program.arrays.theta))), np.empty((3, len(values)))
    )
    set_tip_derivatives(
        model.structure,
        program.arrays,
        GaugeRows(
            _row_copy(scale_mm, 1), _row_copy(joint_mm, 1), _row_copy(frame_mm, 1), np.array([time_s], dtype=np.float64)
        ),
        np.concatenate([values, references]),
        raised,
        WarmRows(
            _row_copy(model.frame.zero_supports_M_mm, 2),
            _row_copy(zero.platform_origin_M_mm, 1),
            _row_copy(zero.rotation_M_P, 2),
            _row_copy(zero.actuator_mm, 1),
        ),
        packed.arrays,
        SolvedRows(np.zeros(1, WORKSPACE), np.zeros(1, RESULT)),
        arrays,
    )
    by_port, by_theta, by_quantity = arrays
    t1 = model.scales + len(joint_mm)
    by_gauge = np.delete(by_port[:, : t1 + 9], np.s_[t1 : t1 + 9 - len(frame_mm)], axis=1)
    derivatives = TipDerivatives(by_gauge, by_theta, by_quantity)
    if program.given:
        rows = _rows(model, scale_mm, joint_mm, frame_mm, quantities, quantities_at_zero, time_s, effects)
        _add_python_effects(model, rows, raised, effects, by_port, derivatives)
    return derivatives


def _row_copy(values: FloatArray, axes: int) -> FloatArray:
    """One row (1, ...) of values with so many axes: a contiguous copy, since the kernel takes no read-only array."""
    return np.array(values, dtype=np.float64, ndmin=axes + 1, order="C")


def _rows(
    model: MachineModel,
    scale_mm: FloatArray,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    quantities: Mapping[str, FloatArray],
    quantities_at_zero: Mapping[str, float],
    time_s: float,
    effects: EffectMemory,
) -> Observations:
    """The snapshot as one row, for effects in plain Python."""
    assert model.constants is not None, "a model with effects has its constants"
    motion = effects.motion
    return observe(
        model,
        model.constants,
        scale_mm=scale_mm[None],
        joint_mm=joint_mm[None],
        frame_mm=frame_mm[None],
        quantities={name: np.array([value]) for name, value in quantities.items()},
        time_s=np.array([time_s]),
        session_start=np.array([False]),
        movement=Movement.unknown(scale_mm[None], joint_mm[None])
        if motion is None
        else Movement.from_motions([motion]),
        quantities_at_zero=quantities_at_zero,
    )


def _add_python_effects(
    model: MachineModel,
    rows: Observations,
    raised: FloatArray,
    effects: EffectMemory,
    by_port: FloatArray,
    derivatives: TipDerivatives,
) -> None:
    """Add what the effects without a kernel give; by_port (3, size), raised (q,) as in the kernel."""
    program = model.program
    for index in program.given:
        fitted, structure = model.live_effects[index], program.arrays.effects[index]
        memory = effects.memories.get(fitted.effect.id)
        basis = evaluate_basis(fitted.effect, rows, fitted.constants, memory)[0][0]
        begin = structure["targets_begin"]
        by_added = by_port[:, program.arrays.targets[begin : begin + structure["size"]]]
        derivatives.by_theta[:, structure["theta_begin"] : structure["theta_end"]] = by_added @ basis
        needed = program.arrays.quantity_indices[structure["quantities_begin"] : structure["quantities_end"]]
        for quantity in needed[: len(needed) // 2]:
            changed = {**rows.quantities, program.quantities[quantity]: raised[quantity : quantity + 1]}
            moved = evaluate_basis(fitted.effect, replace(rows, quantities=changed), fitted.constants, memory)[0][0]
            derivatives.by_quantity[:, quantity] += by_added @ ((moved - basis) @ fitted.theta)
