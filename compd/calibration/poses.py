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
from compd.model import effect_deltas, predict, sum_deltas
from compd.model.effects import FittedEffect


@dataclass(frozen=True, eq=False)
class MeasuredPoses:
    """A recording of N rows with m measured coordinates, and how they change with the P numbers of a drawing.

    columns_mm : (N, m, P) per tolerance.  use : (N,) rows with a pose and every value.
    to_links : (N, n, m) from the measured coordinates to errors of links, in which the rows are then weighed; None
        where they are weighed as measured.
    """

    aligned: AlignedRecording
    columns_mm: FloatArray
    use: BoolArray
    to_links: FloatArray | None = None

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
    def weighed(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Residual (N, w), registration (N, w, Q) and columns (N, w, P) in the coordinates that are weighed."""
        T, residual_mm = self.poses.to_links, self.residual_mm
        if T is None:
            return residual_mm, self.registration_mm, self.poses.columns_mm
        return (T @ residual_mm[:, :, None])[:, :, 0], T @ self.registration_mm, T @ self.poses.columns_mm


def links_of_pose(aligned: AlignedRecording) -> FloatArray | None:
    """(N, n, m) errors of links by errors of the measured coordinates, which they explain at the pose as drawn.

    Of a tip alone the smallest such errors; None where the tip was not measured whole.
    """
    if aligned.of_links or not aligned.shows_tip or aligned.model is None:
        return None
    link = aligned.sensitivity(["link"])["link"]
    both = link.tip
    if aligned.with_attitude:
        both = np.concatenate([link.tip, link.rotation * MM_PER_RAD], axis=1)
    good = np.isfinite(both).all(axis=(1, 2))
    by_pose = np.full((len(both), both.shape[2], both.shape[1]), np.nan)
    by_pose[good] = np.linalg.pinv(both[good])
    return by_pose
