"""By how much the tip of an external machine moves with each of what its uncertainty comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from compd.arrays import FloatArray
from compd.model import EffectMemory, split_by_port
from compd.model.effects import FittedEffect, evaluate_basis, needed_quantities
from compd.model.external.external_model import ExternalModel, ExternalRows, carried_to_pose, external_rows
from compd.model.kinematics import Movement


def external_tip_derivatives(
    model: ExternalModel,
    scale_mm: FloatArray,
    quantities: Mapping[str, FloatArray],
    sigmas: Mapping[str, float],
    time_s: float,
    effects: EffectMemory,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """by_gauge (3, n), by_theta (3, P) and by_quantity (3, q) of one snapshot, as in `TipDerivatives`.

    A quantity that the own kinematics needs as a setting moves the pose itself, which is left out: settings are
    commanded.
    """
    one_row = {name: np.asarray(value, dtype=np.float64).reshape(1) for name, value in quantities.items()}
    found = external_rows(model, scale_mm[None], one_row, np.array([time_s]), None, effects)
    if effects.motion is not None:
        moving = Movement.from_motions([effects.motion])
        rows = replace(found.rows, direction=moving.direction, velocity_mm_per_s=moving.velocity_mm_per_s)
        found = found._replace(rows=rows)
    by_gauge = found.poses[0].by_scale[:3]
    by_theta, by_quantity = [], np.zeros((3, len(model.program.quantities)))
    for fitted in model.live_effects:
        basis = _tip_basis(fitted, found, effects)
        by_theta.append(basis)
        read = needed_quantities(fitted.effect, model.links)
        for index, name in enumerate(model.program.quantities):
            if name not in read or name not in one_row:  # of own kinematics, or an axis that stays still
                continue
            raised = {**found.rows.quantities, name: one_row[name] + sigmas.get(name, np.nan)}
            moved = _tip_basis(fitted, found._replace(rows=replace(found.rows, quantities=raised)), effects)
            by_quantity[:, index] += (moved - basis) @ fitted.theta
    return by_gauge, np.concatenate([np.zeros((3, 0)), *by_theta], axis=1), by_quantity


def _tip_basis(fitted: FittedEffect, found: ExternalRows, effects: EffectMemory) -> FloatArray:
    """(3, P) what one unit of each fitted number does to the tip."""
    rows, poses, _ = found
    memory = effects.memories.get(fitted.effect.id)
    basis = evaluate_basis(fitted.effect, rows, fitted.constants, memory)[0]
    columns = [
        carried_to_pose(split_by_port(fitted.effect, rows, basis[:, :, k]), poses)[0, :3] for k in range(basis.shape[2])
    ]
    return np.stack(columns, axis=1) if columns else np.zeros((3, 0))
