"""Uncertainty of predictions by Monte Carlo, to compare the first order with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.model import GAUGE_PORTS, Deltas, GaugeNoise, split_by_port, sum_deltas
from compd.model.effects import FittedEffect, evaluate_basis
from compd.units import UM_PER_MM


def monte_carlo(
    aligned: AlignedRecording,
    noise: GaugeNoise,
    fitted: Sequence[FittedEffect],
    covariance: FloatArray,
    index: IntArray,
    trials: int,
    seed: int,
) -> FloatArray:
    """(R, m) standard deviation in um of the predictions at the rows `index` (R,), by Monte Carlo (JCGM 101:2008).

    Each trial draws all readings and all fitted numbers from their normal distributions and computes the whole
    forward model, so that what first order leaves out is included.
    """
    assert aligned.model is not None
    rng = np.random.default_rng(seed)
    rows = aligned.rows.select(index)
    bases = [evaluate_basis(effect.effect, aligned.rows, effect.constants, None)[0][index] for effect in fitted]
    theta = np.concatenate([np.zeros(0), *(effect.theta for effect in fitted)])
    root = _covariance_root(covariance)
    predicted = np.empty((trials, len(index), len(aligned.labels)))
    for trial in range(trials):
        numbers = theta + root @ rng.standard_normal(len(theta))
        added: list[Deltas] = [
            {port: rng.standard_normal((len(index), len(noise.at_port(port)))) * noise.at_port(port)}
            for port in GAUGE_PORTS
        ]
        begin = 0
        for effect, basis in zip(fitted, bases, strict=True):
            end = begin + basis.shape[2]
            added.append(split_by_port(effect.effect, rows, basis @ numbers[begin:end]))
            begin = end
        predicted[trial] = aligned.predicted_mm(sum_deltas(added), rows)
    return np.asarray(predicted.std(axis=0, ddof=1) * UM_PER_MM)


def _covariance_root(covariance: FloatArray) -> FloatArray:
    """A matrix whose product with its transpose is the covariance."""
    if not len(covariance):
        return covariance
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
