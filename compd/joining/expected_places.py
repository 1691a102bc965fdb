"""Tip and links in each dwell by the machine's kinematics without effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from compd.arrays import FloatArray
from compd.columns import (
    COMMANDED_ATTITUDE_COLUMNS,
    COMMANDED_COLUMNS,
    frame_columns,
    joint_columns,
    scale_columns,
)
from compd.compensation import scales_of_command
from compd.configuration import Configuration
from compd.machine_builder import build_model
from compd.model import MachineModel, observe, predict
from compd.model.kinematics import Movement
from compd.units import UM_PER_MM


def expected_places_mm(
    configuration: Configuration,
    columns: Mapping[str, FloatArray],
    link: int | None = None,
    place_P_mm: Sequence[float] | None = None,
) -> FloatArray:
    """(D, 3) the tip in {M}, or a reflector that is `place_P_mm` (3,) from it along the axes of {P}; or with `link`
    (from 1) (D, 1) the change of that link. nan where there is no pose.

    columns : name with unit -> (D,) readings, as `dwell_columns` returns them. Comparators that were not recorded
        count as unmoved, as in a comparison.
    Raises KinematicsError for a configuration whose machine zero cannot be computed.
    """
    model = build_model(configuration.geometry, configuration.wiring)
    assert model.constants is not None
    scale_mm = _scales_mm(model, columns)
    count, comparators = len(scale_mm), model.joint_weights.shape[1]

    def comparators_mm(names: tuple[str, ...]) -> FloatArray:
        return np.column_stack([columns.get(name, np.zeros(count)) for name in names]) / UM_PER_MM

    joint_mm = comparators_mm(joint_columns(comparators)) if comparators else np.zeros((count, 0))
    rows = observe(
        model,
        model.constants,
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=comparators_mm(frame_columns(9)),
        quantities={},
        time_s=np.arange(count, dtype=np.float64),
        session_start=np.zeros(count, dtype=bool),
        movement=Movement.unknown(scale_mm, joint_mm),
    )
    prediction = predict(model, rows, {})
    if link is not None:
        return np.asarray(prediction.link_length_mm[:, link - 1 : link] - model.zero.link_length_mm[link - 1])
    place = np.zeros(3) if place_P_mm is None else np.asarray(place_P_mm)
    return np.asarray(prediction.tip_mm + prediction.rotation_M_P @ place)


def _scales_mm(model: MachineModel, columns: Mapping[str, FloatArray]) -> FloatArray:
    """(D, m) as recorded, or as the controller drives the poses that it was told."""
    if set(names := scale_columns(model.scales)) <= set(columns):
        return np.column_stack([columns[name] for name in names])
    nowhere = np.full(len(next(iter(columns.values()))), np.nan)
    told = [columns[name] for name in COMMANDED_ATTITUDE_COLUMNS if name in columns]
    tip_mm = np.column_stack([columns.get(name, nowhere) for name in COMMANDED_COLUMNS])
    return scales_of_command(model, tip_mm, np.column_stack(told) if told else None)
