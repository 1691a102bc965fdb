"""Compare the model with a recording: residual, noise floor, what each source contributes, and where it fails."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from compd.arrays import BoolArray, FloatArray
from compd.comparison.alignment.aligned_recording import AlignedRecording, effect_deltas
from compd.comparison.comparison import COPIED, NO_QUANTITY, Comparison
from compd.comparison.contributions import contributions
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.noise_floor import noise_floor, repeat_scatter
from compd.comparison.nuisance import FittedAlong, fit_along
from compd.comparison.outliers import outlier_rows
from compd.comparison.prediction_uncertainty import Uncertainty, first_order_uncertainty, gauge_noise
from compd.comparison.residual_trends import find_trends
from compd.comparison.white_residual import row_orders
from compd.display_unit import MM_PER_RAD
from compd.errors import RecordingError
from compd.model import GaugeNoise, link_residuals
from compd.model.effects import FittedEffect
from compd.recording import UsableRows
from compd.statistics import copied_rows, last_digit_um
from compd.units import UM_PER_MM

# Outliers bend nuisance terms a little, and these decide which rows are outliers: two rounds settle it.
NUISANCE_ROUNDS = 3


def compare(
    aligned: AlignedRecording,
    fitted: Sequence[FittedEffect] = (),
    covariance: FloatArray | None = None,
    outlier: BoolArray | None = None,
) -> Comparison:
    """Compare a recording with the model and its effects; nothing of these is fitted here, but the nuisance terms are.

    covariance : (P, P) of the effects' parameters jointly; where None, from each effect's own.
    outlier : (N,) rows that do not count; None to find them.
    The criteria are those of the recording.
    Raises CompdError where an effect needs what the recording has not, RecordingError where too few rows are usable.
    """
    criteria = aligned.criteria
    by_effect, total = effect_deltas(fitted, aligned.rows)
    predicted_mm = aligned.predicted_mm(total)
    usable = _usable_rows(aligned, predicted_mm, criteria)
    residual_um = (aligned.measured_mm - predicted_mm) * UM_PER_MM
    usable = usable.without(copied_rows(residual_um, usable.mask), COPIED)
    known = usable.mask
    residual_um[~known] = np.nan
    residual_um, along, outlier = _without_nuisance(aligned, fitted, residual_um, known, criteria, outlier)
    used = known & ~outlier
    gauges, uncertainty = _uncertainty(aligned, residual_um, known, used, fitted, covariance, criteria)
    floor = noise_floor(
        residual_um,
        used,
        aligned.recording.visit,
        _declared_um(aligned),
        np.sqrt(np.mean(uncertainty.noise_um[used] ** 2, axis=0)),
        _last_digit_um(aligned),
        tuple(row_orders(aligned).values()),
        criteria,
        aligned.unit,
        angles=3 if aligned.with_attitude else 0,
    )
    links_um = None
    if aligned.model is not None and aligned.shows_tip:
        links_um = link_residuals(aligned.sensitivity(["link"])["link"], np.nan_to_num(residual_um[:, :3]))
        links_um[~known] = np.nan
    return Comparison(
        aligned=aligned,
        fitted=tuple(fitted),
        residual_um=residual_um,
        used=used,
        outlier=outlier,
        left_out=usable.left_out,
        reason=usable.reason,
        floor=floor,
        uncertainty=uncertainty,
        gauges=gauges,
        contributions=contributions(aligned, fitted, by_effect, used),
        trends=find_trends(aligned, residual_um, links_um, used, floor),
        link_residual_um=links_um,
        attitude_residual_urad=aligned.attitude_residual_urad(total),
        constant_um=np.asarray(along.registration_um[used].mean(axis=0)),
    )


def _usable_rows(aligned: AlignedRecording, predicted_mm: FloatArray, criteria: ComparisonCriteria) -> UsableRows:
    """Rows with a measured and a predicted value."""
    usable = aligned.usable.without(np.asarray(~np.isfinite(predicted_mm).all(axis=1)), NO_QUANTITY)
    if (count := int(usable.mask.sum())) < criteria.fewest_rows:
        raise RecordingError.of(
            str(aligned.recording.path),
            "too few rows can be compared",
            value=str(count),
            allowed=f"{criteria.fewest_rows} or more",
            next_step="; ".join(f"{rows} rows: {reason}" for reason, rows in usable.left_out.items()),
        )
    return usable


def _without_nuisance(
    aligned: AlignedRecording,
    fitted: Sequence[FittedEffect],
    residual_um: FloatArray,
    known: BoolArray,
    criteria: ComparisonCriteria,
    given: BoolArray | None,
) -> tuple[FloatArray, FittedAlong, BoolArray]:
    """The residual (N, m) without what nuisance terms explain, that, and the outliers (N,).

    given : the outliers where they are known.
    """
    if given is not None:
        along = fit_along(aligned, fitted, residual_um, known & ~given)
        return residual_um - along.total_um, along, given & known
    outlier = np.zeros(len(known), dtype=bool)
    for _ in range(NUISANCE_ROUNDS):
        along = fit_along(aligned, fitted, residual_um, known & ~outlier)
        new_outlier = outlier_rows(
            residual_um - along.total_um, known, aligned.recording.visit, criteria, aligned.conditions
        )
        if (new_outlier == outlier).all():
            break
        outlier = new_outlier
    return residual_um - along.total_um, along, outlier


def _uncertainty(
    aligned: AlignedRecording,
    residual_um: FloatArray,
    known: BoolArray,
    used: BoolArray,
    fitted: Sequence[FittedEffect],
    covariance: FloatArray | None,
    criteria: ComparisonCriteria,
) -> tuple[GaugeNoise | None, Uncertainty]:
    """The gauges' noise, None for an external model, and the prediction's uncertainty.

    known : (N,) rows of which residual_um (N, m) is known.  used : (N,) those of them that count.
    """
    if covariance is None:
        covariance = block_diag(*(effect.covariance for effect in fitted)) if fitted else np.zeros((0, 0))
    if aligned.model is None:
        return None, first_order_uncertainty(aligned, None, fitted, covariance)
    # who lifts a probe off and sets it down again moves the scales by the seat's noise, which is the reference's
    gauges = gauge_noise(aligned, from_repeats=aligned.ends is None, usable=known)
    uncertainty = first_order_uncertainty(aligned, gauges, fitted, covariance)
    repeats = repeat_scatter(residual_um, used, aligned.recording.visit, criteria)
    if repeats is not None:
        gauges_um = np.sqrt(np.mean(uncertainty.gauges_um[used] ** 2, axis=0))
        # what the gauges' noise alone does to the residual cannot be more than the residual's own scatter
        if (gauges_um > criteria.most_gauge_share * repeats.by_axis_um).any():
            gauges = gauge_noise(aligned, from_repeats=False, usable=known)
            uncertainty = first_order_uncertainty(aligned, gauges, fitted, covariance)
    return gauges, uncertainty


def _last_digit_um(aligned: AlignedRecording) -> FloatArray:
    """(m,) uncertainty of the last digit of the reference as recorded; 0 of a ball plate, which is calibrated, and of
    pins, of which nothing is read."""
    recording = aligned.recording
    recorded_mm = recording.reference_link_mm if aligned.of_links else recording.reference_mm
    if aligned.of_distance and recording.reference_distance_mm is not None:
        recorded_mm = recording.reference_distance_mm[:, None]
    if recorded_mm is None or recording.plate is not None:
        return np.zeros(len(aligned.labels))
    digits_um = last_digit_um(recorded_mm * UM_PER_MM)
    if aligned.with_attitude and recording.reference_rotation_rad is not None:
        return np.append(digits_um, last_digit_um(recording.reference_rotation_rad * MM_PER_RAD * UM_PER_MM))
    return digits_um


def _declared_um(aligned: AlignedRecording) -> FloatArray:
    """(m,) declared standard uncertainty of the reference; nan where nobody declared it."""
    recording = aligned.recording
    declared_um = recording.reference_sigma_mm * UM_PER_MM
    if aligned.with_attitude and recording.reference is not None:
        return np.append(declared_um, np.full(3, recording.reference.sigma_urad))
    return declared_um
