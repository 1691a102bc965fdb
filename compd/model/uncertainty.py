"""How sure the live tip is: gauges' declared noise and fitted numbers' errors, to first order (GUM, 5.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.model.effect import Deltas, FittedEffect, Memories, Port, deltas_by_effect, needed_quantities, sum_deltas
from compd.model.machine import MachineModel
from compd.model.observations import Observations
from compd.model.prediction import Sensitivity, effect_sensitivity, sensitivities


class GaugeNoise(NamedTuple):
    """Standard deviation of one reading: scale_mm (n,), joint_mm (k,), frame_mm (9,); quantities in their own unit.

    A quantity that is not named has a noise that is not known.
    """

    scale_mm: FloatArray
    joint_mm: FloatArray
    frame_mm: FloatArray
    quantities: Mapping[str, float]


def tip_uncertainty_mm(model: MachineModel, rows: Observations, noise: GaugeNoise, memories: Memories) -> FloatArray:
    """Standard uncertainty of the tip (N, 3): in {M}, with the tool on the plate of the touched place in {P}.

    Errors of different gauges have nothing to do with each other; those of fitted numbers have the model's covariance.
    How an effect at the scales' port changes with their noise is left out: at most a few per cent of that noise.
    nan where a fitted number's error or a needed quantity's noise is not known.
    """
    readings: tuple[tuple[Port, FloatArray], ...] = (
        ("scale", noise.scale_mm),
        ("joint", noise.joint_mm),
        ("frame", noise.frame_mm),
    )
    ports = {port for one in model.live_effects for port in one.effect.ports}
    by = sensitivities(model, rows, {*ports, "scale", "joint", "frame"})
    variance = sum(((by[port].tip ** 2) @ sigma_mm**2 for port, sigma_mm in readings), start=np.zeros((len(rows), 3)))
    variance = variance + _by_parameters(model, rows, by, memories)
    for name in rows.quantities:
        variance = variance + _by_quantity(model, rows, by, memories, name, noise.quantities.get(name, np.nan)) ** 2
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _by_parameters(
    model: MachineModel, rows: Observations, by: Mapping[Port, Sensitivity], memories: Memories
) -> FloatArray:
    """(N, 3) variance, mm2, by the errors of the numbers of the effects that act."""
    parts: list[FloatArray] = []
    used: list[int] = []
    begin = 0
    for one in model.effects:
        end = begin + len(one.theta)
        if one.effect.live:
            basis, _ = one.effect.basis(rows, one.constants, memories.get(one.effect.id))
            parts.append(effect_sensitivity(one.effect, rows, basis, by).tip)
            used += range(begin, end)
        begin = end
    if not parts:
        return np.zeros((len(rows), 3))
    G = np.concatenate(parts, axis=2)
    covariance = model.covariance[np.ix_(used, used)] if len(model.covariance) else np.full((len(used),) * 2, np.nan)
    return np.asarray((G @ covariance * G).sum(axis=2))


def _by_quantity(
    model: MachineModel, rows: Observations, by: Mapping[Port, Sensitivity], memories: Memories, name: str, sigma: float
) -> FloatArray:
    """(N, 3) by how many mm the tip moves when one quantity shows more by its standard deviation."""
    using = [one for one in model.live_effects if name in needed_quantities(one.effect, model.links)]
    more = replace(rows, quantities={**rows.quantities, name: rows.quantities[name] + sigma})
    before, after = (_added(using, seen, memories) for seen in (rows, more))
    moved = (by[port].tip @ (after[port] - before[port])[:, :, None] for port in after)
    return np.asarray(sum(moved, start=np.zeros((len(rows), 3, 1)))[:, :, 0])


def _added(effects: Sequence[FittedEffect], rows: Observations, memories: Memories) -> Deltas:
    each, _ = deltas_by_effect(effects, rows, memories)
    return sum_deltas(list(each.values()))
