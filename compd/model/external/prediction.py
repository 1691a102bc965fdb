"""Poses of rows by own kinematics, or as they were given, with what a model's effects add there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.errors import CompdError
from compd.model import EffectMemory, deltas_by_effect, sum_deltas
from compd.model.effects import needed_quantities
from compd.model.external.external_model import ExternalModel, carried_to_pose, external_rows, moved_pose
from compd.model.external.own_kinematics import OwnPose

_GIVEN = ("model_x_mm", "model_y_mm", "model_z_mm")


class ExternalPrediction(NamedTuple):
    """Where N rows have the tip, and what to add to a command that ignores the effects.

    tip_M_mm, rotation_M_rad : (N, 3), with the effects; the rotation is nan where it is not known.
    tip_correction_mm, rotation_correction_rad : (N, 3), what undoes the effects, as in SETPOINT.
    """

    tip_M_mm: FloatArray
    rotation_M_rad: FloatArray
    tip_correction_mm: FloatArray
    rotation_correction_rad: FloatArray


def predict_external(model: ExternalModel, columns: Mapping[str, FloatArray]) -> ExternalPrediction:
    """Of rows that follow each other in time.

    columns : (N,) each, as in a recording: the scales of a machine with own kinematics, else the pose that was given;
        the quantities of settings and effects; `time_s`, else the rows count as one second apart.
    Raises CompdError with every column that is missing, and OwnKinematicsError where the class gives no pose.
    """
    scales = [f"scale_{i}_mm" for i in range(1, model.links + 1)]
    effects = [name for fitted in model.live_effects for name in needed_quantities(fitted.effect, model.links)]
    given = () if model.own is not None else _GIVEN
    # of a derivative for each axis, one that stays still has none
    needed = [name for name in effects if name not in model.columns and not name.startswith("d_")]
    required = dict.fromkeys([*scales, *model.settings, *given, *needed])
    if missing := [name for name in required if name not in columns]:
        raise CompdError.of(
            "rows",
            "lack columns",
            value=", ".join(missing),
            allowed=", ".join(required),
            next_step="give them; without `kinematics` the pose stands in model_x_mm, model_y_mm, model_z_mm",
        )
    count = len(next(iter(columns.values())))
    scale_mm = np.stack([columns[name] for name in scales], axis=1) if scales else np.zeros((count, 0))
    time_s = columns.get("time_s", np.arange(count, dtype=np.float64))
    poses = None
    if given:
        tips, unknown = np.stack([columns[name] for name in given], axis=1), np.full(3, np.nan)
        poses = [OwnPose(tip, unknown, np.full((6, model.links), np.nan)) for tip in tips]
    read = {name: columns[name] for name in dict.fromkeys([*model.settings, *effects]) if name in columns}
    rows, found, _ = external_rows(model, scale_mm, read, time_s, None, EffectMemory(), poses)
    deltas, _ = deltas_by_effect(model.live_effects, rows, {})
    change = carried_to_pose(sum_deltas(deltas.values()), found) if deltas else np.zeros((count, 6))
    moved = [moved_pose(pose, change[row]) for row, pose in enumerate(found)]
    rotation_rad = np.array([rotation for _, rotation in moved]).reshape(-1, 3)
    return ExternalPrediction(
        np.array([tip for tip, _ in moved]).reshape(-1, 3),
        rotation_rad,
        0.0 - change[:, :3],
        np.where(np.isfinite(rotation_rad), 0.0 - change[:, 3:], np.nan),
    )
