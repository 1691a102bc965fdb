"""What a comparison of the model with a recording says: residual, noise floor, what each source contributes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.special import fdtri

from compd.arrays import BoolArray, FloatArray, TextArray, rms
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.column_faults import column_faults
from compd.comparison.contributions import Contribution
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.noise_floor import NoiseFloor
from compd.comparison.prediction_uncertainty import Uncertainty
from compd.comparison.residual_trends import Trend
from compd.comparison.row_faults import OUTLIER, disagreeing_visits, outlier_faults
from compd.comparison.sampling_error import drawn_together, rms_standard_error, sample_json, sample_text
from compd.data_fault import DataFault
from compd.display_unit import ATTITUDE_UNIT, format_error, residual_ending
from compd.model import GaugeNoise
from compd.model.effects import FittedEffect
from compd.recording import sigma_key
from compd.result_tables import data_frame, html_table
from compd.text import nan_to_null

if TYPE_CHECKING:
    import pandas as pd

# Why a row does not count, beside the reasons of the recording itself, and OUTLIER.
NO_QUANTITY = "a quantity that an effect needs is empty"
COPIED = "an earlier row says the same to the last digit"
# Trends that a notebook shows.
MAX_TRENDS = 4


class Size(NamedTuple):
    """Of amounts: root mean square, what 95 % stay below, and the largest; um."""

    rms_um: float
    p95_um: float
    largest_um: float


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
    reason : (N,) array of str
        Why each row cannot be used; "" for a row that can.
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
    reason: TextArray
    floor: NoiseFloor
    uncertainty: Uncertainty
    gauges: GaugeNoise | None
    contributions: Mapping[str, Contribution]
    trends: tuple[Trend, ...]
    link_residual_um: FloatArray | None
    attitude_residual_urad: FloatArray | None
    constant_um: FloatArray

    @property
    def criteria(self) -> ComparisonCriteria:
        """The thresholds on which it rests, those of its recording, each with unit, meaning and reason."""
        return self.aligned.criteria

    @cached_property
    def rms_by_axis_um(self) -> FloatArray:
        """(m,) root mean square of each coordinate over the rows used."""
        return np.asarray(np.sqrt(np.mean(self.residual_um[self.used] ** 2, axis=0)))

    @cached_property
    def mean_by_axis_um(self) -> FloatArray:
        """(m,) mean of each coordinate over the rows used."""
        return np.asarray(self.residual_um[self.used].mean(axis=0))

    @cached_property
    def p95_by_axis_um(self) -> FloatArray:
        """(m,) what 95 % of the rows used stay below, by amount."""
        return np.asarray(np.quantile(np.abs(self.residual_um[self.used]), 0.95, axis=0))

    @cached_property
    def largest_by_axis_um(self) -> FloatArray:
        """(m,) the largest amount of each coordinate among the rows used."""
        return np.asarray(np.abs(self.residual_um[self.used]).max(axis=0))

    @cached_property
    def distance_size(self) -> Size:
        """Of `distance_um`, over the rows used."""
        distance_um = self.distance_um[self.used]
        return Size(rms(distance_um), float(np.quantile(distance_um, 0.95)), float(distance_um.max()))

    @property
    def rows(self) -> int:
        """N."""
        return self.aligned.recording.rows

    @cached_property
    def rows_used(self) -> int:
        """How many rows count."""
        return int(self.used.sum())

    @cached_property
    def outlier_count(self) -> int:
        """How many rows no noise explains."""
        return int(self.outlier.sum())

    @cached_property
    def outlier_rows(self) -> list[int]:
        """These rows, as a spreadsheet shows them."""
        return [int(row) for row in self.aligned.recording.row[self.outlier]]

    @cached_property
    def faults(self) -> tuple[DataFault, ...]:
        """What is wrong with the data, or looks so: each with its rows, and whether these count."""
        recording, criteria = self.aligned.recording, self.criteria
        residual_um, unit = self.residual_um[:, self.aligned.lengths], self.aligned.unit
        faults = outlier_faults(recording.row, recording.visit, residual_um, self.outlier, self.used, unit)
        if self.floor.source == "repeats":
            noise_um = self.floor.by_axis_um[self.aligned.lengths]
            faults += disagreeing_visits(
                recording.row,
                recording.visit,
                residual_um,
                self.used,
                noise_um,
                unit,
                min_sigmas=criteria.disagreement_sigmas,
                max_share=criteria.max_lone_share / 2,
            )
        return (*column_faults(self.aligned), *recording.faults, *faults)

    @property
    def named_faults(self) -> tuple[DataFault, ...]:
        """Those of `faults` of which more is known than that the rows are beyond all noise."""
        return tuple(fault for fault in self.faults if fault.reason != OUTLIER)

    @property
    def basis(self) -> str:
        """Of a sample: what it is, and what it leaves uncertain, in sentences; else ""."""
        sample = self.aligned.recording.sample
        if sample is None:
            return ""
        return sample_text(sample, self.rows, self.rms_um, self.rms_sampling_error_um, self.aligned.unit)

    @cached_property
    def rms_sampling_error_um(self) -> float:
        """Standard error of `rms_um` by the draw of a sample, 0 of a whole recording."""
        return self._sampling_error(self.residual_um[:, self.aligned.lengths])

    def _sampling_error(self, residual_um: FloatArray) -> float:
        """As `rms_sampling_error_um`, of some coordinates (N, k)."""
        recording, used = self.aligned.recording, self.used
        if recording.sample is None:
            return 0.0
        group = drawn_together(recording.visit, recording.rows)
        return rms_standard_error(residual_um[used], group[used], recording.sample.rows)

    @property
    def rms_um(self) -> float:
        """Root mean square per coordinate, over rows and axes that are lengths; `attitude_rms_urad` is apart."""
        return rms(self.rms_by_axis_um[self.aligned.lengths])

    @property
    def attitude_rms_urad(self) -> float:
        """Root mean square per axis of the attitude over the rows used, urad; nan where none was measured."""
        if self.attitude_residual_urad is None:
            return math.nan
        if self.aligned.with_attitude:
            return rms(self.rms_by_axis_um[-3:])
        return float(np.sqrt(np.nanmean(self.attitude_residual_urad[self.used] ** 2)))

    @cached_property
    def distance_um(self) -> FloatArray:
        """(N,) length of the residual vector of the tip; of link lengths, the largest absolute residual."""
        if self.aligned.of_links:
            return np.asarray(np.abs(self.residual_um).max(axis=1))
        return np.asarray(np.linalg.norm(self.residual_um[:, self.aligned.lengths], axis=1))

    @property
    def floor_ratio(self) -> float:
        """(rms / floor)^2, which is the reduced chi-squared; 1 at the noise floor, inf where the floor is 0.

        Of an attitude beside lengths the mean over the coordinates, each against its own floor.
        """
        if self.aligned.with_attitude and (self.floor.by_axis_um > 0).all():
            return float(np.mean((self.rms_by_axis_um / self.floor.by_axis_um) ** 2))
        return (self.rms_um / self.floor.um) ** 2 if self.floor.um > 0 else math.inf

    @property
    def at_floor(self) -> bool:
        """Whether noise alone could have made the floor ratio as large as it is; False where noise is not known.

        By an F test, a ratio of two variances with as many degrees of freedom as measured values and as the floor
        rests on.
        """
        if not self.floor.known:
            return False
        numbers = float(self.rows_used * len(self.aligned.labels))
        dof = min(self.floor.dof, 1e9)
        return self.floor_ratio <= float(fdtri(numbers, dof, self.criteria.at_floor_confidence))

    @property
    def verdict(self) -> str:
        """The result in a sentence or two, for a person at the machine."""
        unit = self.aligned.unit
        error, noise = format_error(self.rms_um, unit, 3), format_error(self.floor.um, unit, 3)
        if self.aligned.with_attitude:
            error = f"{error} and {format_error(self.attitude_rms_urad, ATTITUDE_UNIT, 3)}"
            noise = f"{noise} and {format_error(rms(self.floor.by_axis_um[-3:]), ATTITUDE_UNIT, 3)}"
        who = f"{self.aligned.recording.machine}: measured and modelled differ by {error} (rms per coordinate)"
        if not math.isnan(self.floor.declared_um):
            declared = format_error(self.floor.declared_um, unit, 3)
            return (
                f"{who}. Noise of {declared} is declared, and neighbouring rows scatter by {noise}. Measure one point "
                "twice, with the same number in the column `visit`, to know how much of it is noise."
            )
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
        return np.where(self.outlier, OUTLIER, self.reason)

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
        ending = residual_ending(self.aligned.unit)
        table = {
            "coordinate": self.aligned.labels,
            f"rms_{ending}": self.rms_by_axis_um.tolist(),
            f"noise_floor_{ending}": self.floor.by_axis_um.tolist(),
            f"95_percent_{ending}": self.p95_by_axis_um.tolist(),
            f"largest_{ending}": self.largest_by_axis_um.tolist(),
        }
        remarks = [
            f"{self.rows_used} rows used, {self.rows - self.rows_used} not. Noise floor: {self.floor.how}.",
            *([self.basis] if self.basis else []),
            *([self.floor.contradiction] if self.floor.contradiction else []),
            *(trend.text for trend in self.trends[:MAX_TRENDS]),
        ]
        return html_table(self.verdict, table, remarks)

    def __repr__(self) -> str:
        return f"<Comparison: {self.verdict}>"

    def as_json(self) -> dict[str, Any]:
        """What `compd compare --json` prints, as plain data; nan and inf are None.

        Keys that end in `_um` hold numbers in `unit`, which is um unless the sidecar names another.
        """
        recording = self.aligned.recording
        excluded = self.rows - self.rows_used + sum(recording.left_out.values())
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
            "residual_mean_xyz_um": self._by_axis(self.mean_by_axis_um),
            "residual_p95_xyz_um": self._by_axis(self.p95_by_axis_um),
            "residual_max_xyz_um": self._by_axis(self.largest_by_axis_um),
            "residual_3d_um": {
                "rms": self.distance_size.rms_um,
                "p95": self.distance_size.p95_um,
                "max": self.distance_size.largest_um,
            },
            "noise_floor_um": self.floor.um,
            "noise_floor_xyz_um": self._by_axis(self.floor.by_axis_um),
            "noise_floor_source": self.floor.source,
            "noise_floor_how": self.floor.how,
            "noise_floor_remark": self.floor.contradiction,
            "floor_ratio": self.floor_ratio,
            "at_floor": self.at_floor,
            "rows_used": self.rows_used,
            "rows_excluded": excluded,
            "excluded_by_reason": {**self.left_out, **self._outlier_count()},
            "outlier_rows": self.outlier_rows,
            **({"data_faults": [fault.text for fault in self.faults]} if self.faults else {}),
            "contributions": {source: part._asdict() for source, part in self.contributions.items()},
            "prediction_std_um": {
                "total": rms(self.uncertainty.total_um[self.used][:, self.aligned.lengths]),
                "gauges": rms(self.uncertainty.gauges_um[self.used][:, self.aligned.lengths]),
                "parameters": rms(self.uncertainty.parameters_um[self.used][:, self.aligned.lengths]),
                "how": "no gauges of its own" if self.gauges is None else self.gauges.how,
            },
            "where_it_fails": [trend.as_json() for trend in self.trends],
            "verdict": self.verdict,
        }
        if self.aligned.registered:
            report["registration"] = self._registration()
        if recording.sample is not None:
            errors = {label: self._sampling_error(self.residual_um[:, [k]]) for k, label in enumerate(report["axes"])}
            report["sample"] = {
                **sample_json(recording.sample, self.rows),
                "residual_rms_standard_error_um": self.rms_sampling_error_um,
                "residual_rms_standard_error_xyz_um": errors,
                "text": self.basis,
            }
        if self.attitude_residual_urad is not None:
            report["attitude_rms_urad"] = self.attitude_rms_urad
            report["attitude_counts"] = self.aligned.with_attitude
        finite: dict[str, Any] = nan_to_null(report)
        return finite

    def _by_axis(self, values: FloatArray) -> dict[str, float]:
        return {label: float(value) for label, value in zip(self.aligned.labels, values, strict=True)}

    def _outlier_count(self) -> dict[str, int]:
        return {OUTLIER: self.outlier_count} if self.outlier_count else {}

    def _registration(self) -> dict[str, Any]:
        registration, ends = self.aligned.registration, self.aligned.ends
        if ends is not None:
            return {
                "how": "the places of the fixed ends, laid over the prediction and fitted along",
                "parameters": ends.parameters,
                "places_mm": dict(zip(ends.name, ends.place_mm.tolist(), strict=True)),
            }
        if registration is None:
            return {"how": "displacements and small rotations fitted along"}
        return {
            "how": "laid over the prediction, six parameters fitted along"
            + (", and three of the target's turn on the platform" if self.aligned.with_attitude else ""),
            "translation_mm": registration.translation_mm.tolist(),
            "rotation": registration.rotation.tolist(),
        }
