"""How sure a prediction is: from the gauges' noise and the fitted numbers' errors, by first order and by trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.noise_floor import repeat_scatter
from compd.model.effect import Deltas, FittedEffect, Port, by_port, sum_deltas
from compd.model.frame import solve_frame
from compd.model.observations import Observations
from compd.model.prediction import STEP_MM
from compd.units import UM_PER_MM

# Standard deviation of an error spread evenly over one step (GUM, F.2.2.1).
PER_STEP = 1.0 / np.sqrt(12.0)
# Last digits of displays, from 50 um down to 0.1 nm.
STEPS_UM = tuple(digit * 10.0**power for power in range(1, -5, -1) for digit in (5, 2, 1))
GAUGE_PORTS: tuple[Port, ...] = ("scale", "joint", "frame")


class GaugeNoise(NamedTuple):
    """Standard deviation of each reading, mm: scale_mm (n,), joint_mm (k,), frame_mm (9,); where it is from."""

    scale_mm: FloatArray
    joint_mm: FloatArray
    frame_mm: FloatArray
    how: str

    def at(self, port: Port) -> FloatArray:
        """Of the readings of one port."""
        return {"scale": self.scale_mm, "joint": self.joint_mm, "frame": self.frame_mm}[port]


class Uncertainty(NamedTuple):
    """Standard uncertainty of each predicted coordinate, (N, m) in um: by the gauges, by the fitted numbers."""

    gauges_um: FloatArray
    parameters_um: FloatArray

    @property
    def total_um(self) -> FloatArray:
        """Both, which have nothing to do with each other."""
        return np.asarray(np.hypot(self.gauges_um, self.parameters_um))


def gauge_noise(
    aligned: AlignedRecording,
    from_repeats: bool = True,
    criteria: ComparisonCriteria = ComparisonCriteria(),
) -> GaugeNoise:
    """Of each gauge: its scatter within visits, at least what its last digit hides; else that alone.

    from_repeats : False where the machine moves within a visit, so that the gauges' scatter is no noise.
    """
    recording, rows = aligned.recording, aligned.rows
    usable, _ = aligned.usable
    found: dict[str, FloatArray] = {}
    repeated = False
    for port in GAUGE_PORTS:
        values_um = {"scale": rows.scale_mm, "joint": rows.joint_mm, "frame": rows.frame_mm}[port] * UM_PER_MM
        by_step = np.array([_step(column) for column in values_um[usable].T]) * PER_STEP
        scatter = None
        if from_repeats and values_um.size:
            scatter = repeat_scatter(values_um, usable, recording.visit, criteria)
        repeated |= scatter is not None
        found[port] = (by_step if scatter is None else np.maximum(scatter.by_axis_um, by_step)) / UM_PER_MM
    how = "scatter of the gauges within visits" if repeated else "the gauges' last digits alone: a lower bound"
    return GaugeNoise(found["scale"], found["joint"], found["frame"], how)


def _step(values_um: FloatArray) -> float:
    """The coarsest decimal step, 1, 2 or 5 of any digit, of which all readings are multiples; 0 for a standing one."""
    values_um = values_um[np.isfinite(values_um)]
    if not len(values_um) or np.ptp(values_um) == 0:
        return 0.0
    for step_um in STEPS_UM:
        counts = values_um / step_um
        if (np.abs(counts - np.round(counts)) < 1e-3).all():
            return step_um
    return 0.0


def first_order(
    aligned: AlignedRecording, noise: GaugeNoise | None, fitted: Sequence[FittedEffect], covariance: FloatArray
) -> Uncertainty:
    """GUM, 5.1: squares of sensitivity times standard uncertainty, added up.

    covariance : (P, P) of all fitted numbers jointly; nan where a number's error is not known, which makes the
    prediction's nan.  noise : None for an external model, whose gauges are its own affair: nan.
    """
    shape = aligned.measured_mm.shape
    variance = np.full(shape, np.nan) if noise is None else np.zeros(shape)
    if noise is not None:
        by = aligned.sensitivity(["scale", "joint", "base_joint"])
        for port in GAUGE_PORTS:
            at = by["base_joint" if port == "frame" else port]
            sensitivity = (at.link_length if aligned.of_links else at.tip)[:, list(aligned.axes)]
            if port == "frame":
                sensitivity = sensitivity @ _base_joints_by_frame(aligned)
            variance += sensitivity**2 @ noise.at(port) ** 2
    parameters = np.zeros(shape)
    if fitted:
        G = np.concatenate([aligned.columns(one.effect, one.shape) for one in fitted], axis=2)
        parameters = np.sqrt(np.maximum((G @ covariance * G).sum(axis=2), 0.0))
    return Uncertainty(np.sqrt(variance) * UM_PER_MM, parameters * UM_PER_MM)


def _base_joints_by_frame(aligned: AlignedRecording) -> FloatArray:
    """(3 n, 9) by how much the base joints move with the frame's distances; by central differences.

    The frame moves by micrometres in a metre: its middle state serves for every row.
    """
    assert aligned.model is not None
    distances_mm = aligned.model.zero.distances_mm + np.nanmedian(aligned.rows.frame_mm, axis=0)
    step = STEP_MM * np.eye(9)
    ends = [solve_frame(aligned.model.frame, distances_mm + signed).base_joints_M_mm for signed in (step, -step)]
    return np.asarray((ends[0] - ends[1]).reshape(9, -1).T / (2 * STEP_MM))


def monte_carlo(
    aligned: AlignedRecording,
    noise: GaugeNoise,
    fitted: Sequence[FittedEffect],
    covariance: FloatArray,
    index: IntArray,
    trials: int,
    seed: int,
) -> FloatArray:
    """(R, m) standard deviation in um of the predictions at the rows `index` (R,), readings and numbers drawn anew.

    The whole forward model each time: what first order leaves out is in it (GUM supplement 1, JCGM 101:2008).
    """
    assert aligned.model is not None
    rng = np.random.default_rng(seed)
    rows = take(aligned.rows, index)
    bases = [one.effect.basis(aligned.rows, one.shape, None)[0][index] for one in fitted]
    theta = np.concatenate([np.zeros(0), *(one.theta for one in fitted)])
    root = _root(covariance)
    predicted = np.empty((trials, len(index), len(aligned.axes)))
    for trial in range(trials):
        drawn = theta + root @ rng.standard_normal(len(theta))
        parts: list[Deltas] = [
            {port: rng.standard_normal((len(index), len(noise.at(port)))) * noise.at(port)} for port in GAUGE_PORTS
        ]
        begin = 0
        for one, basis in zip(fitted, bases, strict=True):
            numbers = drawn[begin : begin + basis.shape[2]]
            parts.append(by_port(one.effect, rows, basis @ numbers))
            begin += basis.shape[2]
        predicted[trial] = aligned.predicted_mm(sum_deltas(parts), rows)
    return np.asarray(predicted.std(axis=0, ddof=1) * UM_PER_MM)


def _root(covariance: FloatArray) -> FloatArray:
    """A matrix whose product with its transpose is the covariance."""
    if not len(covariance):
        return covariance
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def take(rows: Observations, index: IntArray) -> Observations:
    """Some of the rows, in this order."""
    chosen: dict[str, Any] = {}
    for one in fields(Observations):
        value = getattr(rows, one.name)
        if one.name == "quantities":
            chosen[one.name] = {name: column[index] for name, column in value.items()}
        elif one.name != "constants":
            chosen[one.name] = value[index]
    return replace(rows, **chosen)
