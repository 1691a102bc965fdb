"""Machines with effects of their geometry, and where their tips are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compd.calibration import rows_at
from compd.model import MachineModel, effect_deltas, predict, sum_deltas
from compd.model.effects import FittedEffect
from compd.model.library import load_library

# Largest of each unit: what a machine of printed parts may be off by.
LARGEST = {"um": 300.0, "urad": 500.0, "ppm": 800.0}


def random_effects(model: MachineModel, ids: tuple[str, ...], seed: int) -> tuple[FittedEffect, ...]:
    """Those of the effects that the machine can have, with numbers drawn at random."""
    rng = np.random.default_rng(seed)
    hinges = len(model.revolute_axes_P)
    effects = [load_library()[id_] for id_ in ids if hinges or id_ != "revolute_axis_tilt"]
    return tuple(
        FittedEffect(
            effect,
            np.array([rng.uniform(-1, 1) * LARGEST[column.parameter.unit] for column in effect.columns(model.links)]),
            {},
        )
        for effect in effects
    )


def with_effects(model: MachineModel, seed: int) -> MachineModel:
    """The machine with joints, lengths and gains other than drawn."""
    ids = ("link_zero", "base_joint_position", "platform_joint_position", "scale_gain")
    return replace(model, effects=random_effects(model, ids, seed))


def tips(model: MachineModel, scale_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) tips in {M} by the machine with its effects."""
    rows = rows_at(model, scale_mm)
    predicted = predict(model, rows, sum_deltas([effect_deltas(effect, rows)[0] for effect in model.effects]))
    assert not predicted.reason.any()
    return predicted.tip_mm
