"""Uncertainty of a recording's predictions: the gauges' noise propagated to first order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.noise_floor import repeat_scatter
from compd.model import (
    GAUGE_PORTS,
    GaugeNoise,
    carried_by_distances,
    gauge_variance,
    parameter_variance,
)
from compd.model.effects import FittedEffect, evaluate_basis
from compd.statistics import last_digit_um
from compd.units import UM_PER_MM

# Seed of the draw of the quantities' noise.
NOISE_SEED = 20262


class Uncertainty(NamedTuple):
    """Standard uncertainty of each predicted coordinate, (N, m) in um: by the gauges, by the fitted numbers, by what
    the frame moves unmeasured, and by the noise of the quantities from which effects are computed.
    """

    gauges_um: FloatArray
    parameters_um: FloatArray
    frame_um: FloatArray
    quantities_um: FloatArray

    @property
    def noise_um(self) -> FloatArray:
        """What changes from reading to reading: the gauges' and the quantities' noise."""
        return np.asarray(np.sqrt(self.gauges_um**2 + self.quantities_um**2))

    @property
    def total_um(self) -> FloatArray:
        """All of them, which are independent of each other."""
        return np.asarray(np.sqrt(self.noise_um**2 + self.parameters_um**2 + self.frame_um**2))


def gauge_noise(aligned: AlignedRecording, from_repeats: bool = True, usable: BoolArray | None = None) -> GaugeNoise:
    """Of each gauge: its scatter within visits, but at least the uncertainty of its last digit; else that alone.

    from_repeats : False where the machine moves within a visit, so that the gauges' scatter is no noise.
    usable : (N,) rows that count; None for all complete ones.
    """
    recording, rows = aligned.recording, aligned.rows
    usable = aligned.usable.mask if usable is None else usable
    noise_mm: dict[str, FloatArray] = {}
    repeated = False
    for port in GAUGE_PORTS:
        values_um = {"scale": rows.scale_mm, "joint": rows.joint_mm, "frame": rows.frame_mm}[port] * UM_PER_MM
        by_digit = last_digit_um(values_um[usable])
        scatter = None
        if from_repeats and values_um.size:
            scatter = repeat_scatter(values_um, usable, recording.visit, aligned.criteria)
        repeated |= scatter is not None
        noise_mm[port] = (by_digit if scatter is None else np.maximum(scatter.by_axis_um, by_digit)) / UM_PER_MM
    how = "scatter of the gauges within visits" if repeated else "the gauges' last digits alone: a lower bound"
    drift_mm = _frame_drift_mm(aligned)
    if drift_mm:
        unknown = np.isnan(drift_mm)
        how += f"; the frame moves unmeasured by {'an unknown amount' if unknown else f'{drift_mm * UM_PER_MM:g} um'}"
    return GaugeNoise(noise_mm["scale"], noise_mm["joint"], noise_mm["frame"], how=how, frame_drift_mm=drift_mm)


def _frame_drift_mm(aligned: AlignedRecording) -> float:
    """Of the tip along each axis; 0 of links' lengths, which are measured between their joints."""
    return 0.0 if aligned.model is None or aligned.of_links else aligned.model.frame_drift_mm


def first_order_uncertainty(
    aligned: AlignedRecording, noise: GaugeNoise | None, fitted: Sequence[FittedEffect], covariance: FloatArray
) -> Uncertainty:
    """GUM 5.1.2 and 5.2.2, see `compd.model.uncertainty`, for every coordinate that the reference measures.

    covariance : (P, P) of all fitted numbers jointly; nan where a number's error is not known, which makes the
    prediction's nan.  noise : None for an external model, whose gauges are not known: nan.
    The frame moves by micrometres in a metre: its derivatives are taken once, at the median of the readings.
    """
    shape = aligned.measured_mm.shape
    variance = np.full(shape, np.nan)
    if noise is not None:
        assert aligned.model is not None
        middle_mm = aligned.model.zero.distances_mm + np.nanmedian(aligned.rows.frame_mm, axis=0)
        carried = carried_by_distances(
            aligned.model, middle_mm[None], np.nanmedian(aligned.rows.scale_mm, axis=0)[None]
        )
        sensitivities = aligned.sensitivity(["scale", "joint", *carried])
        by_port = {port: aligned.shown(sensitivity) for port, sensitivity in sensitivities.items()}
        by_port["frame"] = np.asarray(sum(by_port.pop(port) @ moved[0] for port, moved in carried.items()))
        variance = gauge_variance(by_port, noise)
    parameters = np.zeros(shape)
    if fitted:
        derivatives = np.concatenate([aligned.columns(effect.effect, effect.constants) for effect in fitted], axis=2)
        parameters = np.sqrt(np.maximum(parameter_variance(derivatives, covariance), 0.0))
    frame_mm = 0.0 if noise is None else noise.frame_drift_mm
    return Uncertainty(
        np.sqrt(variance) * UM_PER_MM,
        parameters * UM_PER_MM,
        np.full(shape, frame_mm * UM_PER_MM),
        np.broadcast_to(_by_quantities_mm(aligned, fitted) * UM_PER_MM, shape),
    )


def _by_quantities_mm(aligned: AlignedRecording, fitted: Sequence[FittedEffect]) -> FloatArray:
    """(m,) standard deviation of each coordinate by the stated noise of the quantities that effects are computed from.

    From one draw of the noise of all rows (JCGM 101:2008), through the memory of effects that have one.
    """
    rows, moved_mm = aligned.rows, np.zeros(aligned.measured_mm.shape)
    stated = {} if aligned.model is None else aligned.model.quantity_noise
    rng = np.random.default_rng(NOISE_SEED)
    noisy = {
        name: values + stated[name] * rng.standard_normal(len(values)) if name in stated else values
        for name, values in rows.quantities.items()
    }
    drawn = replace(rows, quantities=noisy)
    for effect in fitted if stated else ():
        with_noise, _ = evaluate_basis(effect.effect, drawn, effect.constants, None)
        without, _ = evaluate_basis(effect.effect, rows, effect.constants, None)
        added: FloatArray = np.einsum("rsp,p->rs", with_noise - without, effect.theta)
        changes: FloatArray = aligned.propagated(effect.effect, added[:, :, np.newaxis])
        moved_mm = moved_mm + changes[:, :, 0]
    known = moved_mm[np.isfinite(moved_mm).all(axis=1)]
    return np.asarray(np.sqrt(np.mean(known**2, axis=0)) if len(known) else np.zeros(len(aligned.labels)))
