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

from compd.arrays import BoolArray, FloatArray
from compd.comparison.criteria import ComparisonCriteria
from compd.statistics import MIN_SIGMA, robust_sigma

# Converges in three or four rounds: each drops the rows that the last one shows to be outliers.
ROUNDS = 10
# Three points fix a frame.
MIN_POINTS = 3
# mm; points that are all nearer to their middle than this have no spread to scale by.
MIN_SPREAD_MM = 1e-9


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

    Of points in a plane the third coordinate is 0 on both sides, and the motion stays in the plane. Rows that are nan
    on either side are left out. None where fewer than three rows are left: nothing fixes a frame.
    """
    known = np.isfinite(measured_mm).all(axis=1) & np.isfinite(predicted_M_mm).all(axis=1)
    use = known.copy()
    registration: Registration | None = None
    for _ in range(ROUNDS):
        if use.sum() < MIN_POINTS:
            return None
        registration = _rigid_motion(measured_mm[use], predicted_M_mm[use])
        distance_mm = np.linalg.norm(predicted_M_mm - registration.into_M(measured_mm), axis=1)
        limit_mm = criteria.outlier_sigmas * float(robust_sigma(distance_mm[use][:, None])[0])
        near = known & (distance_mm <= max(limit_mm, MIN_SIGMA))
        if (near == use).all():
            break
        use = near
    return registration


def _rigid_motion(measured_mm: FloatArray, predicted_mm: FloatArray) -> Registration:
    """Least-squares rotation about the centroids, then the translation between them.

    `Rotation.align_vectors` solves sum |p_i - R q_i|^2 by singular values (W. Kabsch, Acta Cryst. A32 (1976) 922) and
    returns a rotation, never a mirror image. In a plane, which half a turn about one of its lines would mirror, the
    solution is the angle of sum (p_i . q_i, q_i x p_i).
    """
    measured_centroid_mm, predicted_centroid_mm = measured_mm.mean(axis=0), predicted_mm.mean(axis=0)
    q, p = measured_mm - measured_centroid_mm, predicted_mm - predicted_centroid_mm
    if not p[:, 2].any() and not q[:, 2].any():
        angle_rad = np.arctan2((q[:, 0] * p[:, 1] - q[:, 1] * p[:, 0]).sum(), (q[:, :2] * p[:, :2]).sum())
        rotation = Rotation.from_rotvec([0.0, 0.0, angle_rad])
    else:
        rotation, _ = Rotation.align_vectors(p, q)
    matrix = rotation.as_matrix()
    return Registration(matrix, predicted_centroid_mm - matrix @ measured_centroid_mm, len(measured_mm))


def registration_columns(
    tip_M_mm: FloatArray, axes: Sequence[int], points_M_mm: FloatArray | None = None
) -> FloatArray:
    """(N, m, m + 3 or fewer) derivatives of what the instrument shows by a small motion of its frame.

    tip_M_mm : (N, 3) modelled points, nan along axes that are not known.  axes : the m measured ones, 0, 1, 2 for
        x, y, z.  points_M_mm : (K, 3) the points about which rotations are counted; the N ones if None.
    The first m columns are displacements along `axes`: unit vectors. Then come small rotations about the centroid c of
    the points, phi x (p_i - c), divided by the points' spread s = rms of the coordinates of p_i - c: so all have one
    size and unit (mm). A rotation that moves a measured coordinate by one that is not known is left out: of points in a
    plane only the rotation in the plane is left.
    """
    columns = list(displacement_columns(len(tip_M_mm), len(axes)).transpose(2, 0, 1))
    points_M_mm = tip_M_mm if points_M_mm is None else points_M_mm
    known: BoolArray = np.asarray(np.isfinite(points_M_mm).any(axis=0))
    rows = np.isfinite(points_M_mm[:, known]).all(axis=1)
    if not known.any() or not rows.any():
        return np.stack(columns, axis=2)
    lever_mm = tip_M_mm - points_M_mm[rows].mean(axis=0)
    spread_mm = points_spread_mm(points_M_mm)
    for about in range(3):
        first, second = (about + 1) % 3, (about + 2) % 3
        # phi e_about x lever: the first axis moves by minus the second's lever, the second by the first's
        moves = [(axis, lever, sign) for axis, lever, sign in ((first, second, -1), (second, first, 1)) if axis in axes]
        if moves and all(known[lever] for _, lever, _ in moves):
            column = np.zeros((len(tip_M_mm), len(axes)))
            for axis, lever, sign in moves:
                column[:, list(axes).index(axis)] = sign * lever_mm[:, lever] / spread_mm
            columns.append(column)
    return np.stack(columns, axis=2)


def points_spread_mm(tip_M_mm: FloatArray) -> float:
    """Root mean square of the coordinates of points (N, 3) from their centroid, along the axes that are known."""
    known: BoolArray = np.asarray(np.isfinite(tip_M_mm).any(axis=0))
    points_mm = tip_M_mm[:, known][np.isfinite(tip_M_mm[:, known]).all(axis=1)]
    if not points_mm.size:
        return MIN_SPREAD_MM
    return max(float(np.sqrt(np.mean((points_mm - points_mm.mean(axis=0)) ** 2))), MIN_SPREAD_MM)


def displacement_columns(rows: int, coordinates: int) -> FloatArray:
    """(N, m, m) derivatives of m coordinates by a constant along each: unit vectors."""
    return np.broadcast_to(np.eye(coordinates), (rows, coordinates, coordinates))
