"""The model beside a recording: residual, noise floor, what each source contributes, and where it fails."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.stats import f as f_distribution

from compd.arrays import BoolArray, FloatArray
from compd.comparison.aligned_recording import AlignedRecording, added_by
from compd.comparison.contributions import Contribution, contributions
from compd.comparison.fit import free_motion_of
from compd.comparison.noise_floor import NoiseFloor, noise_floor, outlier_rows, repeat_scatter
from compd.comparison.prediction_uncertainty import Uncertainty, first_order_uncertainty, gauge_noise
from compd.comparison.residual_trends import Trend, find_trends
from compd.errors import Problem, RecordingError
from compd.json_text import nan_to_null
from compd.model.effect import FittedEffect
from compd.model.sensitivity import link_residuals
from compd.model.uncertainty import GaugeNoise
from compd.units import UM_PER_MM

# A ratio beyond what chance makes of a model at the floor in 97.5 of 100 recordings is above the floor.
CONFIDENCE = 0.975
FEWEST_ROWS = 5


@dataclass(frozen=True, eq=False)
class Comparison:
    """One recording against one model. N rows, m coordinates; um.

    fitted : the model's effects.  residual_um : (N, m) measured - modelled, nan where a row cannot be used.
    used : (N,) the rows that count.  outlier : (N,) rows beyond all noise.  left_out : reason -> rows.
    floor : the noise floor.  uncertainty : of the prediction.  gauges : their noise, None for an external model.
    sources : what each source contributes.  findings : where the model fails.
    link_residual_um : (N, n) the residual as errors of link lengths, None where there are no links to blame.
    attitude_residual_urad : (N, 3), None where no attitude was measured.
    """

    aligned: AlignedRecording
    fitted: tuple[FittedEffect, ...]
    residual_um: FloatArray
    used: BoolArray
    outlier: BoolArray
    left_out: Mapping[str, int]
    floor: NoiseFloor
    uncertainty: Uncertainty
    gauges: GaugeNoise | None
    sources: Mapping[str, Contribution]
    findings: tuple[Trend, ...]
    link_residual_um: FloatArray | None
    attitude_residual_urad: FloatArray | None

    @cached_property
    def rms_by_axis_um(self) -> FloatArray:
        """(m,)."""
        return np.asarray(np.sqrt(np.mean(self.residual_um[self.used] ** 2, axis=0)))

    @property
    def rms_um(self) -> float:
        """Per coordinate, over rows and axes."""
        return float(np.sqrt(np.mean(self.rms_by_axis_um**2)))

    @cached_property
    def distance_um(self) -> FloatArray:
        """(N,) length of the residual over all coordinates; of links, the largest."""
        if self.aligned.of_links:
            return np.asarray(np.abs(self.residual_um).max(axis=1))
        return np.asarray(np.linalg.norm(self.residual_um, axis=1))

    @property
    def floor_ratio(self) -> float:
        """(rms / floor)^2: 1 at the floor, inf where the floor is nothing."""
        return (self.rms_um / self.floor.um) ** 2 if self.floor.um > 0 else math.inf

    @property
    def at_floor(self) -> bool:
        """Whether chance alone could have made the ratio as large as it is."""
        numbers = float(self.used.sum() * len(self.aligned.labels))
        dof = min(self.floor.dof, 1e9)
        return self.floor_ratio <= float(f_distribution.ppf(CONFIDENCE, numbers, dof))

    @property
    def verdict(self) -> str:
        """The result in a sentence or two, for a person at the machine."""
        who = f"{self.aligned.recording.machine}: measured and modelled differ by {self.rms_um:.3g} um (rms per coordinate)"
        if self.at_floor:
            return f"{who}, which is the noise of the measurement itself ({self.floor.um:.3g} um): nothing is missing."
        share = 1 - 1 / self.floor_ratio
        return (
            f"{who}; noise alone would be {self.floor.um:.3g} um. {100 * share:.0f} % of the squared error has a cause "
            "that the model does not have."
        )

    def as_json(self) -> dict[str, Any]:
        """What `compd compare --json` prints; nan and inf are null."""
        recording = self.aligned.recording
        size = np.abs(self.residual_um[self.used])
        distance = self.distance_um[self.used]
        excluded = recording.rows - int(self.used.sum()) + sum(recording.left_out.values())
        found: dict[str, Any] = {
            "recording": str(recording.path),
            "sha256": recording.sha256,
            "machine": recording.machine,
            "effects": [one.effect.id for one in self.fitted],
            "axes": list(self.aligned.labels),
            "residual_rms_um": self.rms_um,
            "residual_rms_xyz_um": self._by_axis(self.rms_by_axis_um),
            "residual_mean_xyz_um": self._by_axis(self.residual_um[self.used].mean(axis=0)),
            "residual_p95_xyz_um": self._by_axis(np.quantile(size, 0.95, axis=0)),
            "residual_max_xyz_um": self._by_axis(size.max(axis=0)),
            "residual_3d_um": {
                "rms": float(np.sqrt(np.mean(distance**2))),
                "p95": float(np.quantile(distance, 0.95)),
                "max": float(distance.max()),
            },
            "noise_floor_um": self.floor.um,
            "noise_floor_xyz_um": self._by_axis(self.floor.by_axis_um),
            "noise_floor_source": self.floor.source,
            "noise_floor_how": self.floor.how,
            "floor_ratio": self.floor_ratio,
            "at_floor": self.at_floor,
            "rows_used": int(self.used.sum()),
            "rows_excluded": excluded,
            "excluded_by_reason": {**self.left_out, **self._outliers_counted()},
            "outlier_rows": recording.row[self.outlier].tolist(),
            "contributions": {name: one._asdict() for name, one in self.sources.items()},
            "prediction_std_um": {
                "total": _typical(self.uncertainty.total_um[self.used]),
                "gauges": _typical(self.uncertainty.gauges_um[self.used]),
                "parameters": _typical(self.uncertainty.parameters_um[self.used]),
                "how": "no gauges of its own" if self.gauges is None else self.gauges.how,
            },
            "where_it_fails": [finding.as_json() for finding in self.findings],
            "verdict": self.verdict,
        }
        if self.aligned.registered:
            found["registration"] = self._registration()
        if self.attitude_residual_urad is not None:
            turned = self.attitude_residual_urad[self.used]
            found["attitude_rms_urad"] = float(np.sqrt(np.nanmean(turned**2)))
        finite: dict[str, Any] = nan_to_null(found)
        return finite

    def _by_axis(self, values: FloatArray) -> dict[str, float]:
        return {label: float(value) for label, value in zip(self.aligned.labels, values, strict=True)}

    def _outliers_counted(self) -> dict[str, int]:
        count = int(self.outlier.sum())
        return {"beyond all noise": count} if count else {}

    def _registration(self) -> dict[str, Any]:
        laid = self.aligned.registration
        if laid is None:
            return {"how": "displacements and small rotations fitted along"}
        return {
            "how": "laid over the prediction, six parameters fitted along",
            "translation_mm": laid.translation_mm.tolist(),
            "rotation": laid.rotation.tolist(),
        }


def compare(
    aligned: AlignedRecording, fitted: Sequence[FittedEffect] = (), covariance: FloatArray | None = None
) -> Comparison:
    """Compare a recording with the model and its effects; nothing of the model is fitted here.

    covariance : (P, P) of the effects' numbers jointly; where None, from each effect's own.
    Raises CompdError where an effect needs what the recording has not, RecordingError where too few rows are usable.
    """
    by_effect, added = added_by(fitted, aligned.rows)
    usable, left = aligned.usable
    predicted_mm = aligned.predicted_mm(added)
    known = usable & np.isfinite(predicted_mm).all(axis=1)
    left_out = dict(left)
    if (usable & ~known).any():
        left_out["a quantity that an effect needs is empty"] = int((usable & ~known).sum())
    if known.sum() < FEWEST_ROWS:
        raise RecordingError(
            Problem(
                where=str(aligned.recording.path),
                what="too few rows can be compared",
                value=str(int(known.sum())),
                allowed=f"{FEWEST_ROWS} or more",
                next_step="; ".join(f"{n} rows: {why}" for why, n in left_out.items()),
            )
        )
    residual_um = (aligned.measured_mm - predicted_mm) * UM_PER_MM
    residual_um[~known] = np.nan
    residual_um, outlier = _without_frame(aligned, residual_um, known)
    used = known & ~outlier
    gauges, uncertainty = _uncertainty(aligned, residual_um, used, fitted, covariance)
    floor = noise_floor(
        residual_um,
        used,
        aligned.recording.visit,
        aligned.recording.reference_sigma_mm * UM_PER_MM,
        np.sqrt(np.mean(uncertainty.gauges_um[used] ** 2, axis=0)),
        _orders(aligned),
    )
    links_um = None
    if aligned.model is not None and not aligned.of_links and len(aligned.axes) == 3:
        links_um = link_residuals(aligned.sensitivity(["link"])["link"], np.nan_to_num(residual_um))
        links_um[~known] = np.nan
    turned = aligned.attitude_residual_urad(added)
    return Comparison(
        aligned,
        tuple(fitted),
        residual_um,
        used,
        outlier,
        left_out,
        floor,
        uncertainty,
        gauges,
        contributions(aligned, by_effect, used),
        find_trends(aligned, residual_um, links_um, used, floor),
        links_um,
        turned,
    )


def _without_frame(
    aligned: AlignedRecording, residual_um: FloatArray, known: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """The residual without what the instrument's frame explains, and the rows beyond all noise."""
    outlier = np.zeros(len(known), dtype=bool)
    left_um = residual_um
    for _ in range(3):  # a gross row bends the frame a little, and the frame decides which row is gross
        left_um = residual_um - free_motion_of(aligned, residual_um, known & ~outlier)
        found = outlier_rows(left_um, known, aligned.recording.visit)
        if (found == outlier).all():
            break
        outlier = found
    return left_um, outlier


def _uncertainty(
    aligned: AlignedRecording,
    residual_um: FloatArray,
    used: BoolArray,
    fitted: Sequence[FittedEffect],
    covariance: FloatArray | None,
) -> tuple[GaugeNoise | None, Uncertainty]:
    """The gauges' noise and the prediction's uncertainty."""
    joint = _blocks([one.covariance for one in fitted]) if covariance is None else covariance
    if aligned.model is None:
        return None, first_order_uncertainty(aligned, None, fitted, joint)
    gauges = gauge_noise(aligned)
    found = first_order_uncertainty(aligned, gauges, fitted, joint)
    repeats = repeat_scatter(residual_um, used, aligned.recording.visit)
    # what the gauges' scatter alone would do to the residual cannot be more than the residual's own scatter
    if repeats is not None and (np.sqrt(np.mean(found.gauges_um[used] ** 2, axis=0)) > 1.5 * repeats.by_axis_um).any():
        gauges = gauge_noise(aligned, from_repeats=False)
        found = first_order_uncertainty(aligned, gauges, fitted, joint)
    return gauges, found


def _orders(aligned: AlignedRecording) -> tuple[FloatArray, ...]:
    """What rows can be neighbours in: time, place, everything measured."""
    place = [column for column in aligned.rows.tip_M_mm.T if np.isfinite(column).any()]
    return (aligned.recording.time_s, *place, *aligned.recording.quantities.values())


def _blocks(parts: Sequence[FloatArray]) -> FloatArray:
    """Block-diagonal."""
    size = sum(len(part) for part in parts)
    found = np.zeros((size, size))
    begin = 0
    for part in parts:
        found[begin : begin + len(part), begin : begin + len(part)] = part
        begin += len(part)
    return found


def _typical(values_um: FloatArray) -> float:
    return float(np.sqrt(np.mean(values_um**2)))
