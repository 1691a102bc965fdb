"""Measured poses of one recording beside what the machine with its numbers so far predicts of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from compd.arrays import BoolArray, FloatArray, rms
from compd.calibration.jacobian import measured_columns, moved_to
from compd.calibration.parameters import Parameters
from compd.comparison import AlignedRecording, aligned_with
from compd.display_unit import MM_PER_RAD
from compd.model import Prediction, effect_deltas, predict, sum_deltas
from compd.model.effects import FittedEffect
from compd.statistics import trimmed_scale

# By how many times the scatter of the measured attitudes the predicted ones must vary, rms, to show a target's place:
# the place times that scatter is then less than the noise of a position.
_SHOWN_TIMES = 3.0


@dataclass(frozen=True, eq=False)
class MeasuredPoses:
    """A recording of N rows with m measured coordinates, and how they change with the P numbers of a drawing.

    columns_mm : (N, m, P) per tolerance, of the machine as drawn.  use : (N,) rows with a pose and every value.
    to_links : (N, n, m) from the measured coordinates to errors of links, in which the rows are then weighed; None
        where they are weighed as measured.
    """

    aligned: AlignedRecording
    parameters: Parameters
    columns_mm: FloatArray
    use: BoolArray
    to_links: FloatArray | None = None

    @classmethod
    def of(cls, aligned: AlignedRecording, parameters: Parameters) -> MeasuredPoses:
        """Of a recording with the parameters of its machine."""
        columns_mm = measured_columns(aligned, parameters)
        use = aligned.usable.mask & np.isfinite(columns_mm).all(axis=(1, 2))
        return cls(aligned, parameters, columns_mm, use)

    def now(self, fitted: Sequence[FittedEffect], left_out: BoolArray | None = None) -> PosesNow:
        """What is left with these effects, the instrument registered to their prediction, and its derivatives there.

        left_out : (N,) poses to which it is not registered.
        """
        aligned, model = self.aligned, self.aligned.model
        assert model is not None
        added = sum_deltas([effect_deltas(one, aligned.rows)[0] for one in fitted])
        prediction = predict(model, aligned.rows, added)
        aligned = _with_shown_place(aligned_with(aligned, prediction, left_out), prediction, left_out)
        residual_mm = aligned.measured_mm - aligned.predicted_mm(added)
        registration_mm = aligned.registration_columns
        columns_mm = self.columns_mm
        if fitted:
            columns_mm = measured_columns(moved_to(aligned, prediction, added), self.parameters, aligned.rows)
        finite = np.isfinite(residual_mm).all(axis=1) & np.isfinite(registration_mm).all(axis=(1, 2))
        use = self.use & finite & np.isfinite(columns_mm).all(axis=(1, 2))
        return PosesNow(self, aligned, residual_mm, registration_mm, columns_mm, use)


@dataclass(frozen=True, eq=False)
class PosesNow:
    """The same with the numbers so far.

    residual_mm : (N, m).  registration_mm : (N, m, Q) columns of what is fitted along.  columns_mm : (N, m, P) per
    tolerance.  use : (N,).
    """

    poses: MeasuredPoses
    aligned: AlignedRecording
    residual_mm: FloatArray
    registration_mm: FloatArray
    columns_mm: FloatArray
    use: BoolArray

    @cached_property
    def weighed(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Residual (N, w), registration (N, w, Q) and columns (N, w, P) in the coordinates that are weighed."""
        T, residual_mm = self.poses.to_links, self.residual_mm
        if T is None:
            return residual_mm, self.registration_mm, self.columns_mm
        return (T @ residual_mm[:, :, None])[:, :, 0], T @ self.registration_mm, T @ self.columns_mm


def _with_shown_place(
    aligned: AlignedRecording, prediction: Prediction, left_out: BoolArray | None
) -> AlignedRecording:
    """The recording with the place of its target wherever the tilts of the prediction show it beyond their error.

    A machine whose platform only shifts tilts by its errors: a target 30 mm from the tip then moves by 20 um, which
    would count as errors of the tip.
    """
    if not aligned.with_attitude or aligned.target is None or aligned.target.directions_P.shape[1] == 3:
        return aligned
    left_mm = aligned.measured_mm[aligned.usable.mask, -3:]
    motion = _SHOWN_TIMES * rms(trimmed_scale(left_mm)) / MM_PER_RAD
    if motion >= aligned.criteria.min_target_motion:
        return aligned
    finer = replace(aligned, criteria=replace(aligned.criteria, min_target_motion=motion))
    return replace(aligned_with(finer, prediction, left_out), criteria=aligned.criteria)


def links_of_pose(aligned: AlignedRecording) -> FloatArray | None:
    """(N, n, m) errors of links by errors of the measured coordinates, which they explain at the pose as drawn.

    Of a tip alone the smallest such errors; None where the tip was not measured whole.
    """
    if aligned.of_links or not aligned.shows_tip or aligned.model is None:
        return None
    link = aligned.sensitivity(["link"])["link"]
    both = aligned.shown(link)
    good = np.isfinite(both).all(axis=(1, 2))
    by_pose = np.full((len(both), both.shape[2], both.shape[1]), np.nan)
    by_pose[good] = np.linalg.pinv(both[good])
    return by_pose
