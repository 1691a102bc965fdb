"""Measured poses of one recording beside what the machine with its numbers so far predicts of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.calibration.jacobian import measured_columns
from compd.calibration.parameters import Parameters
from compd.comparison import AlignedRecording, aligned_with
from compd.display_unit import MM_PER_RAD
from compd.model import Sensitivity, effect_deltas, link_residuals, predict, sum_deltas
from compd.model.effects import FittedEffect


@dataclass(frozen=True, eq=False)
class MeasuredPoses:
    """A recording of N rows with m measured coordinates, and how they change with the P numbers of a drawing.

    columns_mm : (N, m, P) per tolerance.  use : (N,) rows with a pose and every value.
    """

    aligned: AlignedRecording
    columns_mm: FloatArray
    use: BoolArray

    @classmethod
    def of(cls, aligned: AlignedRecording, parameters: Parameters) -> MeasuredPoses:
        """Of a recording with the parameters of its machine."""
        columns_mm = measured_columns(aligned, parameters)
        use = aligned.usable.mask & np.isfinite(columns_mm).all(axis=(1, 2))
        return cls(aligned, columns_mm, use)

    def now(self, fitted: tuple[FittedEffect, ...]) -> PosesNow:
        """What is left with these effects, the instrument registered to their prediction."""
        aligned = self.aligned
        added = sum_deltas([effect_deltas(one, aligned.rows)[0] for one in fitted])
        if aligned.model is not None:
            aligned = aligned_with(aligned, predict(aligned.model, aligned.rows, added))
        residual_mm = aligned.measured_mm - aligned.predicted_mm(added)
        registration_mm = aligned.registration_columns
        finite = np.isfinite(residual_mm).all(axis=1) & np.isfinite(registration_mm).all(axis=(1, 2))
        return PosesNow(self, aligned, residual_mm, registration_mm, self.use & finite)


@dataclass(frozen=True, eq=False)
class PosesNow:
    """The same with the numbers so far.

    residual_mm : (N, m).  registration_mm : (N, m, Q) columns of what is fitted along.  use : (N,).
    """

    poses: MeasuredPoses
    aligned: AlignedRecording
    residual_mm: FloatArray
    registration_mm: FloatArray
    use: BoolArray

    @cached_property
    def link_sensitivity(self) -> Sensitivity:
        """Of the drawing's pose by the lengths of links."""
        return self.poses.aligned.sensitivity(["link"])["link"]

    def links_mm(self, residual_mm: FloatArray) -> FloatArray:
        """(N, n) errors of links that would make a residual (N, m); nan where the tip was not measured whole."""
        aligned, link = self.poses.aligned, self.link_sensitivity
        if aligned.of_links or not aligned.shows_tip:
            return np.full((len(residual_mm), link.tip.shape[2]), np.nan)
        if not aligned.with_attitude:
            return link_residuals(link, residual_mm[:, :3])
        both = np.concatenate([link.tip, link.rotation * MM_PER_RAD], axis=1)
        good = np.isfinite(both).all(axis=(1, 2))
        errors_mm = np.full((len(good), both.shape[2]), np.nan)
        errors_mm[good] = (np.linalg.pinv(both[good]) @ residual_mm[good, :, None])[:, :, 0]
        return errors_mm
