"""The model beside a recording: residual, noise floor, what each source contributes, and where it fails."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import block_diag
from scipy.special import fdtri

from compd.arrays import BoolArray, FloatArray, TextArray, rms
from compd.comparison.aligned_recording import AlignedRecording, effect_deltas
from compd.comparison.contributions import Contribution, contributions
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.display_unit import format_error, residual_ending
from compd.comparison.noise_floor import NoiseFloor, noise_floor, repeat_scatter
from compd.comparison.nuisance import FittedAlong, fit_along
from compd.comparison.outliers import outlier_rows
from compd.comparison.prediction_uncertainty import Uncertainty, first_order_uncertainty, gauge_noise
from compd.comparison.residual_trends import Trend, find_trends
from compd.comparison.statistics.last_digit import last_digit_um
from compd.errors import Problem, RecordingError
from compd.json_text import nan_to_null
from compd.model.effect import FittedEffect
from compd.model.sensitivity import link_residuals
from compd.model.uncertainty import GaugeNoise
from compd.recording.columns import is_sensitivity
from compd.recording.reference import sigma_key
from compd.tables import data_frame, html_table
from compd.units import UM_PER_MM

if TYPE_CHECKING:
    import pandas as pd

# Outliers bend nuisance terms a little, and these decide which rows are outliers: two rounds settle it.
NUISANCE_ROUNDS = 3
# Why a row does not count, beside the reasons of the recording itself.
NO_QUANTITY = "a quantity that an effect needs is empty"
OUTLIER = "beyond all noise"
# Trends that a notebook shows.
MOST_TRENDS = 4


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """One recording of N rows with m measured coordinates against one model.

    Attributes
    ----------
    aligned : AlignedRecording
        The recording with its machine.
    fitted : tuple of FittedEffect
        The effects of the model.
    residual_um : (N, m) array
        Measured minus modelled, um (or in `aligned.unit`, as all numbers in um); nan where a row cannot be used.
    used : (N,) array of bool
        The rows that count.
    outlier : (N,) array of bool
        Rows whose residual no noise explains; they are not used.
    left_out : dict
        Reason, and the number of rows that cannot be used for it.
    floor : NoiseFloor
        What noise alone makes of the residual: `floor.um` per coordinate, `floor.how` says where it is from,
        `floor.known` whether it was measured or declared.
    uncertainty : Uncertainty
        Standard uncertainty of the prediction, um, by gauges and by fitted parameters.
    gauges : GaugeNoise or None
        Noise of the gauges; None for an external model.
    contributions : dict
        What each source contributes: joints, frame, each effect.
    trends : tuple of Trend
        What the residual follows, the strongest first; `trend.text` says it in a sentence.
    link_residual_um : (N, n) array or None
        The residual as errors of link lengths, um; None where none can be inferred.
    attitude_residual_urad : (N, 3) array or None
        Rotation vector from the modelled to the measured attitude in {M}, urad; None where none was measured.
    criteria : ComparisonCriteria
        The thresholds on which it rests, each with unit, meaning and reason.
    constant_um : (m,) array
        Constant of each coordinate that was taken off the residual, um: of an external model, or an instrument's frame;
        zeros for a machine in its own frame.
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
    contributions: Mapping[str, Contribution]
    trends: tuple[Trend, ...]
    link_residual_um: FloatArray | None
    attitude_residual_urad: FloatArray | None
    criteria: ComparisonCriteria
    constant_um: FloatArray

    @cached_property
    def rms_by_axis_um(self) -> FloatArray:
        """(m,) root mean square of each coordinate over the rows used."""
        return np.asarray(np.sqrt(np.mean(self.residual_um[self.used] ** 2, axis=0)))

    @property
    def rms_um(self) -> float:
        """Root mean square per coordinate, over rows and axes."""
        return rms(self.rms_by_axis_um)

    @cached_property
    def distance_um(self) -> FloatArray:
        """(N,) length of the residual vector; of link lengths, the largest absolute residual."""
        if self.aligned.of_links:
            return np.asarray(np.abs(self.residual_um).max(axis=1))
        return np.asarray(np.linalg.norm(self.residual_um, axis=1))

    @property
    def floor_ratio(self) -> float:
        """(rms / floor)^2, which is the reduced chi-squared; 1 at the noise floor, inf where the floor is 0."""
        return (self.rms_um / self.floor.um) ** 2 if self.floor.um > 0 else math.inf

    @property
    def at_floor(self) -> bool:
        """Whether noise alone could have made the floor ratio as large as it is; False where noise is not known.

        By an F test, a ratio of two variances with as many degrees of freedom as measured values and as the floor
        rests on.
        """
        if not self.floor.known:
            return False
        numbers = float(self.used.sum() * len(self.aligned.labels))
        dof = min(self.floor.dof, 1e9)
        return self.floor_ratio <= float(fdtri(numbers, dof, self.criteria.at_floor_confidence))

    @property
    def verdict(self) -> str:
        """The result in a sentence or two, for a person at the machine."""
        unit = self.aligned.unit
        error, noise = format_error(self.rms_um, unit, 3), format_error(self.floor.um, unit, 3)
        who = f"{self.aligned.recording.machine}: measured and modelled differ by {error} (rms per coordinate)"
        if not self.floor.known:
            return (
                f"{who}. How much of it is noise cannot be known: measure one point twice, with the same number in the "
                f"column `visit`, or declare the reference's uncertainty, `{sigma_key(unit)}`."
            )
        if self.at_floor:
            return f"{who}, which is the noise of the measurement itself ({noise}): nothing is missing."
        share = 1 - 1 / self.floor_ratio
        return (
            f"{who}; noise alone would be {noise}. {100 * share:.0f} % of the squared error has a cause that the model "
            "does not have."
        )

    @property
    def why_left_out(self) -> TextArray:
        """(N,) why each row is not used, in words; "" for a row that is used."""
        reason = self.aligned.usable.reason.copy()
        reason[(reason == "") & ~np.isfinite(self.residual_um).all(axis=1)] = NO_QUANTITY
        reason[self.outlier] = OUTLIER
        return reason

    def to_dataframe(self) -> pd.DataFrame:
        """One row per row of the recording, as a pandas data frame.

        Returns
        -------
        pandas.DataFrame
            N rows: `row`, the row as a spreadsheet shows it; `time_s`; for each measured coordinate `residual_x_um`
            (or `residual_link_1_um`; in another unit `residual_x_arcsec` ...), measured minus modelled, nan where a row
            cannot be used; `used` and `outlier`, true or false; `why_left_out`, the reason in words or an empty text.

        Raises
        ------
        CompdError
            Where pandas is not installed.
        """
        names, ending = self.aligned.label_names, residual_ending(self.aligned.unit)
        return data_frame(
            {
                "row": self.aligned.recording.row,
                "time_s": self.aligned.recording.time_s,
                **{f"residual_{name}_{ending}": self.residual_um[:, k] for k, name in enumerate(names)},
                "used": self.used,
                "outlier": self.outlier,
                "why_left_out": self.why_left_out,
            }
        )

    def _repr_html_(self) -> str:
        size_um, ending = np.abs(self.residual_um[self.used]), residual_ending(self.aligned.unit)
        table = {
            "coordinate": self.aligned.labels,
            f"rms_{ending}": self.rms_by_axis_um.tolist(),
            f"noise_floor_{ending}": self.floor.by_axis_um.tolist(),
            f"95_percent_{ending}": np.quantile(size_um, 0.95, axis=0).tolist(),
            f"largest_{ending}": size_um.max(axis=0).tolist(),
        }
        remarks = [
            f"{int(self.used.sum())} rows used, {len(self.used) - int(self.used.sum())} not. "
            f"Noise floor: {self.floor.how}.",
            *([self.floor.contradiction] if self.floor.contradiction else []),
            *(trend.text for trend in self.trends[:MOST_TRENDS]),
        ]
        return html_table(self.verdict, table, remarks)

    def __repr__(self) -> str:
        return f"<Comparison: {self.verdict}>"

    def as_json(self) -> dict[str, Any]:
        """What `compd compare --json` prints, as plain data; nan and inf are None.

        Keys that end in `_um` hold numbers in `unit`, which is um unless the sidecar names another.
        """
        recording = self.aligned.recording
        size = np.abs(self.residual_um[self.used])
        distance = self.distance_um[self.used]
        excluded = recording.rows - int(self.used.sum()) + sum(recording.left_out.values())
        report: dict[str, Any] = {
            "recording": str(recording.path),
            "sha256": recording.sha256,
            "machine": recording.machine,
            "unit": self.aligned.unit,
            "effects": [effect.effect.id for effect in self.fitted],
            "axes": list(self.aligned.labels),
            "residual_rms_um": self.rms_um,
            "residual_rms_xyz_um": self._by_axis(self.rms_by_axis_um),
            "constant_xyz_um": self._by_axis(self.constant_um),
            "residual_mean_xyz_um": self._by_axis(self.residual_um[self.used].mean(axis=0)),
            "residual_p95_xyz_um": self._by_axis(np.quantile(size, 0.95, axis=0)),
            "residual_max_xyz_um": self._by_axis(size.max(axis=0)),
            "residual_3d_um": {
                "rms": rms(distance),
                "p95": float(np.quantile(distance, 0.95)),
                "max": float(distance.max()),
            },
            "noise_floor_um": self.floor.um,
            "noise_floor_xyz_um": self._by_axis(self.floor.by_axis_um),
            "noise_floor_source": self.floor.source,
            "noise_floor_how": self.floor.how,
            "noise_floor_remark": self.floor.contradiction,
            "floor_ratio": self.floor_ratio,
            "at_floor": self.at_floor,
            "rows_used": int(self.used.sum()),
            "rows_excluded": excluded,
            "excluded_by_reason": {**self.left_out, **self._outlier_count()},
            "outlier_rows": recording.row[self.outlier].tolist(),
            "contributions": {source: part._asdict() for source, part in self.contributions.items()},
            "prediction_std_um": {
                "total": rms(self.uncertainty.total_um[self.used]),
                "gauges": rms(self.uncertainty.gauges_um[self.used]),
                "parameters": rms(self.uncertainty.parameters_um[self.used]),
                "how": "no gauges of its own" if self.gauges is None else self.gauges.how,
            },
            "where_it_fails": [trend.as_json() for trend in self.trends],
            "verdict": self.verdict,
        }
        if self.aligned.registered:
            report["registration"] = self._registration()
        if self.attitude_residual_urad is not None:
            attitude_urad = self.attitude_residual_urad[self.used]
            report["attitude_rms_urad"] = float(np.sqrt(np.nanmean(attitude_urad**2)))
        finite: dict[str, Any] = nan_to_null(report)
        return finite

    def _by_axis(self, values: FloatArray) -> dict[str, float]:
        return {label: float(value) for label, value in zip(self.aligned.labels, values, strict=True)}

    def _outlier_count(self) -> dict[str, int]:
        count = int(self.outlier.sum())
        return {OUTLIER: count} if count else {}

    def _registration(self) -> dict[str, Any]:
        registration = self.aligned.registration
        if registration is None:
            return {"how": "displacements and small rotations fitted along"}
        return {
            "how": "laid over the prediction, six parameters fitted along",
            "translation_mm": registration.translation_mm.tolist(),
            "rotation": registration.rotation.tolist(),
        }


def compare(
    aligned: AlignedRecording,
    fitted: Sequence[FittedEffect] = (),
    covariance: FloatArray | None = None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    outlier: BoolArray | None = None,
) -> Comparison:
    """Compare a recording with the model and its effects; nothing of these is fitted here, but the nuisance terms are.

    covariance : (P, P) of the effects' parameters jointly; where None, from each effect's own.
    outlier : (N,) rows that do not count; None to find them.
    Raises CompdError where an effect needs what the recording has not, RecordingError where too few rows are usable.
    """
    by_effect, total = effect_deltas(fitted, aligned.rows)
    predicted_mm = aligned.predicted_mm(total)
    known, left_out = _known_rows(aligned, predicted_mm, criteria)
    residual_um = (aligned.measured_mm - predicted_mm) * UM_PER_MM
    residual_um[~known] = np.nan
    residual_um, along, outlier = _without_nuisance(aligned, fitted, residual_um, known, criteria, outlier)
    used = known & ~outlier
    gauges, uncertainty = _uncertainty(aligned, residual_um, used, fitted, covariance, criteria)
    floor = noise_floor(
        residual_um,
        used,
        aligned.recording.visit,
        aligned.recording.reference_sigma_mm * UM_PER_MM,
        np.sqrt(np.mean(uncertainty.gauges_um[used] ** 2, axis=0)),
        _last_digit_um(aligned),
        _orders(aligned),
        criteria,
        aligned.unit,
    )
    links_um = None
    if aligned.model is not None and not aligned.of_links and len(aligned.axes) == 3:
        links_um = link_residuals(aligned.sensitivity(["link"])["link"], np.nan_to_num(residual_um))
        links_um[~known] = np.nan
    return Comparison(
        aligned=aligned,
        fitted=tuple(fitted),
        residual_um=residual_um,
        used=used,
        outlier=outlier,
        left_out=left_out,
        floor=floor,
        uncertainty=uncertainty,
        gauges=gauges,
        contributions=contributions(aligned, fitted, by_effect, used),
        trends=find_trends(aligned, residual_um, links_um, used, floor, criteria),
        link_residual_um=links_um,
        attitude_residual_urad=aligned.attitude_residual_urad(total),
        criteria=criteria,
        constant_um=np.asarray(along.registration_um[used].mean(axis=0)),
    )


def _known_rows(
    aligned: AlignedRecording, predicted_mm: FloatArray, criteria: ComparisonCriteria
) -> tuple[BoolArray, dict[str, int]]:
    """(N,) rows with a measured and a predicted value; and reason -> number of the other rows."""
    usable = aligned.usable.mask
    known = usable & np.isfinite(predicted_mm).all(axis=1)
    left_out = dict(aligned.usable.left_out)
    if (usable & ~known).any():
        left_out[NO_QUANTITY] = int((usable & ~known).sum())
    if known.sum() < criteria.fewest_rows:
        raise RecordingError(
            Problem(
                where=str(aligned.recording.path),
                what="too few rows can be compared",
                value=str(int(known.sum())),
                allowed=f"{criteria.fewest_rows} or more",
                next_step="; ".join(f"{count} rows: {reason}" for reason, count in left_out.items()),
            )
        )
    return known, left_out


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
        new_outlier = outlier_rows(residual_um - along.total_um, known, aligned.recording.visit, criteria)
        if (new_outlier == outlier).all():
            break
        outlier = new_outlier
    return residual_um - along.total_um, along, outlier


def _uncertainty(
    aligned: AlignedRecording,
    residual_um: FloatArray,
    used: BoolArray,
    fitted: Sequence[FittedEffect],
    covariance: FloatArray | None,
    criteria: ComparisonCriteria,
) -> tuple[GaugeNoise | None, Uncertainty]:
    """The gauges' noise, None for an external model, and the prediction's uncertainty."""
    if covariance is None:
        covariance = block_diag(*(effect.covariance for effect in fitted)) if fitted else np.zeros((0, 0))
    if aligned.model is None:
        return None, first_order_uncertainty(aligned, None, fitted, covariance)
    gauges = gauge_noise(aligned)
    uncertainty = first_order_uncertainty(aligned, gauges, fitted, covariance)
    repeats = repeat_scatter(residual_um, used, aligned.recording.visit)
    if repeats is not None:
        gauges_um = np.sqrt(np.mean(uncertainty.gauges_um[used] ** 2, axis=0))
        # what the gauges' noise alone does to the residual cannot be more than the residual's own scatter
        if (gauges_um > criteria.most_gauge_share * repeats.by_axis_um).any():
            gauges = gauge_noise(aligned, from_repeats=False)
            uncertainty = first_order_uncertainty(aligned, gauges, fitted, covariance)
    return gauges, uncertainty


def _last_digit_um(aligned: AlignedRecording) -> FloatArray:
    """(m,) uncertainty of the last digit of the reference as recorded; 0 of a ball plate, which is calibrated."""
    recording = aligned.recording
    recorded_mm = recording.reference_link_mm if aligned.of_links else recording.reference_mm
    if recorded_mm is None or recording.plate is not None:
        return np.zeros(len(aligned.labels))
    return last_digit_um(recorded_mm * UM_PER_MM)


def _orders(aligned: AlignedRecording) -> tuple[FloatArray, ...]:
    """Quantities (N,) in whose order rows are neighbours: time, place, everything measured."""
    places = [column for column in aligned.rows.tip_M_mm.T if np.isfinite(column).any()]
    measured = [values for name, values in aligned.recording.quantities.items() if not is_sensitivity(name)]
    return (aligned.recording.time_s, *places, *measured)
