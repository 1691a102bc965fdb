"""Registration: where the frame of an instrument (laser tracker, ball plate) lies in {M}.

Registered twice. First the measured points are laid over the model's prediction by a rigid motion (`register`),
because an instrument may stand anywhere. Then every fit has six more columns (`registration_columns`) for the small
motion by which that first registration is wrong, because the prediction that it rests on lacks the effects still to
be found.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.robust import LEAST_SIGMA, robust_sigma

# Converges in three or four rounds: each drops the rows that the last one shows to be outliers.
ROUNDS = 10
# Three points fix a frame.
FEWEST_POINTS = 3
# mm; points that are all nearer to their middle than this have no spread to scale by.
LEAST_SPREAD_MM = 1e-9


class Registration(NamedTuple):
    """x_M = rotation x_instrument + translation_mm: rotation (3, 3), translation_mm (3,), from `rows` rows."""

    rotation: FloatArray
    translation_mm: FloatArray
    rows: int

    def into_M(self, measured_mm: FloatArray) -> FloatArray:
        """(N, 3) points of the instrument's frame in {M}."""
        return np.asarray(measured_mm @ self.rotation.T + self.translation_mm)


def register(
    measured_mm: FloatArray,
    predicted_M_mm: FloatArray,
    criteria: ComparisonCriteria = ComparisonCriteria(),
) -> Registration | None:
    """The rigid motion that lays points (N, 3) over predicted ones (N, 3), by least squares without outliers.

    Rows that are nan on either side are left out. None where fewer than three rows are left: nothing fixes a frame.
    """
    known = np.isfinite(measured_mm).all(axis=1) & np.isfinite(predicted_M_mm).all(axis=1)
    use = known.copy()
    registration: Registration | None = None
    for _ in range(ROUNDS):
        if use.sum() < FEWEST_POINTS:
            return None
        registration = _rigid_motion(measured_mm[use], predicted_M_mm[use])
        distance_mm = np.linalg.norm(predicted_M_mm - registration.into_M(measured_mm), axis=1)
        limit_mm = criteria.outlier_sigmas * float(robust_sigma(distance_mm[use][:, None])[0])
        near = known & (distance_mm <= max(limit_mm, LEAST_SIGMA))
        if (near == use).all():
            break
        use = near
    return registration


def _rigid_motion(measured_mm: FloatArray, predicted_mm: FloatArray) -> Registration:
    """Least-squares rotation about the centroids, then the translation between them.

    `Rotation.align_vectors` solves sum |p_i - R q_i|^2 by singular values (W. Kabsch, Acta Cryst. A32 (1976) 922) and
    returns a rotation, never a mirror image.
    """
    measured_centroid_mm, predicted_centroid_mm = measured_mm.mean(axis=0), predicted_mm.mean(axis=0)
    rotation, _ = Rotation.align_vectors(predicted_mm - predicted_centroid_mm, measured_mm - measured_centroid_mm)
    matrix = rotation.as_matrix()
    return Registration(matrix, predicted_centroid_mm - matrix @ measured_centroid_mm, len(measured_mm))


def registration_columns(tip_M_mm: FloatArray, axes: Sequence[int]) -> FloatArray:
    """(N, m, m + 3) derivatives of what the instrument shows by a small motion of its frame.

    tip_M_mm : (N, 3) modelled points.  axes : the m measured ones of 0, 1, 2 = x, y, z.
    The first m columns are displacements along `axes`: unit vectors. The last three are small rotations about the
    centroid c of the points, phi x (p_i - c), divided by the points' spread s = rms of the coordinates of p_i - c: so
    all have one size and unit (mm). Where no point is known in all three axes there are only displacements.
    """
    N = len(tip_M_mm)
    displacement = np.broadcast_to(np.eye(3)[:, list(axes)].T, (N, len(axes), 3))[:, :, list(axes)]
    known = np.isfinite(tip_M_mm).all(axis=1)
    if not known.any():
        return np.asarray(displacement)
    lever_mm = tip_M_mm - tip_M_mm[known].mean(axis=0)
    spread_mm = float(np.sqrt(np.mean(lever_mm[known] ** 2)))
    x, y, z = (lever_mm / max(spread_mm, LEAST_SPREAD_MM)).T
    rotation = np.zeros((N, 3, 3))
    rotation[:, 0, 1], rotation[:, 0, 2] = z, -y
    rotation[:, 1, 0], rotation[:, 1, 2] = -z, x
    rotation[:, 2, 0], rotation[:, 2, 1] = y, -x
    return np.concatenate([displacement, rotation[:, list(axes)]], axis=2)
