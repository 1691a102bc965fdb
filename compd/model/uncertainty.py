"""Uncertainty of the tip from the gauges' noise and the fitted numbers' errors, to first order (GUM, JCGM 100:2008).

GUM 5.1.2, for errors that are independent: u^2 = sum_i (c_i u_i)^2 with sensitivity coefficients c_i. GUM 5.2.2, for
fitted numbers, whose errors are correlated: u^2 = g^T V g with their covariance V. The two are independent of each
other, so that their variances add up. An uncertainty that is not known is nan and stays nan in the sum.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.model.deltas import Deltas, Memories, deltas_by_effect, sum_deltas
from compd.model.effect import FittedEffect, Port
from compd.model.effect_basis import evaluate_basis
from compd.model.effect_needs import needed_quantities
from compd.model.machine import MachineModel
from compd.model.observations import Observations
from compd.model.sensitivity import Sensitivity, effect_sensitivity, sensitivities

# The ports at which length gauges are read, in the order in which their variances are added up.
GAUGE_PORTS: tuple[Port, ...] = ("scale", "joint", "frame")


class GaugeNoise(NamedTuple):
    """Standard deviation of one reading of each gauge.

    scale_mm (n,), joint_mm (k,), frame_mm (9,).
    quantities : of other gauges by name, in their own unit; one that is not named has an unknown noise.
    how : how the noise was found, for people.
    """

    scale_mm: FloatArray
    joint_mm: FloatArray
    frame_mm: FloatArray
    quantities: Mapping[str, float] = MappingProxyType({})
    how: str = ""

    def at_port(self, port: Port) -> FloatArray:
        """Of the gauges of one of GAUGE_PORTS, mm."""
        return {"scale": self.scale_mm, "joint": self.joint_mm, "frame": self.frame_mm}[port]


def gauge_variance(sensitivity: Mapping[Port, FloatArray], noise: GaugeNoise) -> FloatArray:
    """GUM 5.1.2: variance (N, m), in mm2, of m predicted coordinates by the noise of all length gauges.

    sensitivity : (N, m, size) for each of GAUGE_PORTS, mm per mm.

    Example: a tip that moves by 1.2 mm per mm of each of three scales with a noise of 0.1 um, and by nothing else, has
    a variance of 3 (1.2 x 1e-4 mm)^2 and a standard uncertainty of 0.21 um.
    """
    return np.asarray(sum(sensitivity[port] ** 2 @ noise.at_port(port) ** 2 for port in GAUGE_PORTS))


def parameter_variance(derivatives: FloatArray, covariance: FloatArray) -> FloatArray:
    """GUM 5.2.2: variance (N, m) of m predicted coordinates by the errors of P fitted numbers, g^T V g for each.

    derivatives : (N, m, P), of each coordinate by each number.  covariance : (P, P); nan in it makes the variance nan.
    """
    return np.asarray((derivatives @ covariance * derivatives).sum(axis=2))


def tip_sensitivities(model: MachineModel, rows: Observations) -> dict[Port, Sensitivity]:
    """Derivatives of the tip at every port at which a gauge is read or an effect adds, for `tip_uncertainty_mm`."""
    return sensitivities(
        model, rows, {*GAUGE_PORTS, *(port for fitted in model.live_effects for port in fitted.effect.ports)}
    )


def tip_uncertainty_mm(
    model: MachineModel,
    rows: Observations,
    noise: GaugeNoise,
    memories: Memories,
    by_port: Mapping[Port, Sensitivity] | None = None,
) -> FloatArray:
    """Standard uncertainty of the tip (N, 3): in {M}, with the tool on the plate of the touched place in {P}.

    by_port : the `tip_sensitivities` at these rows, where they are known already.

    The noise of the scales also changes what an effect at the port `scale` adds; that is left out: at most a few per
    cent of the noise itself.
    nan where a fitted number's error or a needed quantity's noise is not known.
    """
    by_port = tip_sensitivities(model, rows) if by_port is None else by_port
    variance = gauge_variance({port: by_port[port].tip for port in GAUGE_PORTS}, noise)
    variance = variance + _variance_by_effects(model, rows, by_port, memories)
    for name in rows.quantities:
        error_mm = _tip_by_quantity(model, rows, by_port, memories, name, noise.quantities.get(name, np.nan))
        variance = variance + error_mm**2
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _variance_by_effects(
    model: MachineModel, rows: Observations, by_port: Mapping[Port, Sensitivity], memories: Memories
) -> FloatArray:
    """(N, 3) variance, mm2, by the errors of the live effects' numbers."""
    derivatives: list[FloatArray] = []
    live: list[int] = []  # places of the live effects' numbers in the model's covariance
    begin = 0
    for fitted in model.effects:
        end = begin + len(fitted.theta)
        if fitted.effect.live:
            basis, _ = evaluate_basis(fitted.effect, rows, fitted.constants, memories.get(fitted.effect.id))
            derivatives.append(effect_sensitivity(fitted.effect, rows, basis, by_port).tip)
            live += range(begin, end)
        begin = end
    if not derivatives:
        return np.zeros((len(rows), 3))
    unknown = np.full((len(live),) * 2, np.nan)
    covariance = model.covariance[np.ix_(live, live)] if len(model.covariance) else unknown
    return parameter_variance(np.concatenate(derivatives, axis=2), covariance)


def _tip_by_quantity(
    model: MachineModel,
    rows: Observations,
    by_port: Mapping[Port, Sensitivity],
    memories: Memories,
    name: str,
    sigma: float,
) -> FloatArray:
    """(N, 3) by how many mm the tip moves when one quantity reads more by its standard deviation sigma."""
    effects = [fitted for fitted in model.live_effects if name in needed_quantities(fitted.effect, model.links)]
    raised = replace(rows, quantities={**rows.quantities, name: rows.quantities[name] + sigma})
    before, after = (_total_deltas(effects, observations, memories) for observations in (rows, raised))
    tip_mm = (by_port[port].tip @ (after[port] - before[port])[:, :, None] for port in after)
    return np.asarray(sum(tip_mm, start=np.zeros((len(rows), 3, 1)))[:, :, 0])


def _total_deltas(effects: Sequence[FittedEffect], rows: Observations, memories: Memories) -> Deltas:
    by_effect, _ = deltas_by_effect(effects, rows, memories)
    return sum_deltas(list(by_effect.values()))
