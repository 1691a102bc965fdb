"""Where the instrument's frame is in {M}: laid over the prediction first, then six parameters fitted along."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.noise_floor import OUTLIER_SIGMAS, robust_sigma

# Laying over converges in three or four rounds: each drops the rows that the last one shows to be gross.
ROUNDS = 10


class Registration(NamedTuple):
    """x_M = rotation x_instrument + translation_mm: rotation (3, 3), translation_mm (3,), from `rows` rows."""

    rotation: FloatArray
    translation_mm: FloatArray
    rows: int

    def into_M(self, measured_mm: FloatArray) -> FloatArray:
        """(N, 3) in the instrument's frame -> in {M}."""
        return np.asarray(measured_mm @ self.rotation.T + self.translation_mm)


def register(measured_mm: FloatArray, predicted_M_mm: FloatArray) -> Registration | None:
    """The rigid motion that lays points (N, 3) over predicted ones, least squares without gross rows.

    Rows that are nan on either side are left out. None where fewer than three rows are left: nothing fixes a frame.
    (Arun, Huang, Blostein, IEEE PAMI 9 (1987) 698: by singular values.)
    """
    known = np.isfinite(measured_mm).all(axis=1) & np.isfinite(predicted_M_mm).all(axis=1)
    keep = known.copy()
    found: Registration | None = None
    for _ in range(ROUNDS):
        if keep.sum() < 3:
            return None
        found = _rigid(measured_mm[keep], predicted_M_mm[keep])
        distance_mm = np.linalg.norm(predicted_M_mm - found.into_M(measured_mm), axis=1)
        limit_mm = OUTLIER_SIGMAS * float(robust_sigma(distance_mm[keep][:, None])[0])
        kept = known & (distance_mm <= max(limit_mm, 1e-9))
        if (kept == keep).all():
            break
        keep = kept
    return found


def _rigid(measured_mm: FloatArray, predicted_mm: FloatArray) -> Registration:
    middle, goal = measured_mm.mean(axis=0), predicted_mm.mean(axis=0)
    u, _, vt = np.linalg.svd((predicted_mm - goal).T @ (measured_mm - middle))
    turn = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])  # a rotation, never a mirror image
    rotation = u @ turn @ vt
    return Registration(rotation, goal - rotation @ middle, len(measured_mm))


def free_motion(tip_M_mm: FloatArray, axes: Sequence[int]) -> FloatArray:
    """Columns (N, axes, 6 or fewer) by which a small motion of the instrument's frame moves what it shows.

    Displacements in mm, rotations about the middle of the points times the points' spread, so that all columns have
    one size. Where the tip is not known in all three axes, only displacements of the axes that there are.
    """
    count = len(tip_M_mm)
    displacement = np.broadcast_to(np.eye(3)[:, list(axes)].T, (count, len(axes), 3))[:, :, list(axes)]
    known = np.isfinite(tip_M_mm).all(axis=1)
    if not known.any():
        return np.asarray(displacement)
    lever_mm = tip_M_mm - tip_M_mm[known].mean(axis=0)
    lever = lever_mm / max(float(np.sqrt(np.mean(lever_mm[known] ** 2))), 1e-9)
    rotation = np.zeros((count, 3, 3))
    x, y, z = lever.T
    rotation[:, 0, 1], rotation[:, 0, 2] = z, -y
    rotation[:, 1, 0], rotation[:, 1, 2] = -z, x
    rotation[:, 2, 0], rotation[:, 2, 1] = y, -x
    return np.concatenate([displacement, rotation[:, list(axes)]], axis=2)
