"""The attitude as measured coordinates beside the tip: three angles in urad, of which one counts as a micrometre.

Attitudes near the modelled one R of a row are written as the rotation vector w from it, about {M}'s axes::

    attitude = exp(w) R

so that without effects the prediction is 0, and what effects add is small. Weights are by each coordinate's own noise;
lengths and angles share no number that people read.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.comparison.alignment.registration import Registration
from compd.model.kernels.rotation import compose, rotation_matrix, rotation_vector

LABELS = ("rx", "ry", "rz")
UNIT = "urad"
# mm that stand for a radian: 1 urad counts as 1 um.
MM_PER_RAD = 1e3


def attitude_mm(rotation_M_P: FloatArray, nominal_M_P: FloatArray) -> FloatArray:
    """(N, 3) the rotation vector from nominal attitudes (N, 3, 3) to others, one urad counted as a um."""
    return np.asarray(rotation_vector(compose(rotation_M_P, nominal_M_P.transpose(0, 2, 1)))) * MM_PER_RAD


def measured_attitude(
    rotation_rad: FloatArray, nominal_M_P: FloatArray, registration: Registration | None
) -> FloatArray:
    """(N, 3, 3) attitudes in {M} from rotation vectors (N, 3) as they were measured.

    registration : of the instrument's frame; None for attitudes of {P} in {M}. In its own frame an instrument knows
    its target's attitude, not that of {P}: how the target is turned on the platform is found as the mean over all rows.
    """
    attitude = rotation_matrix(rotation_rad)
    if registration is None:
        return np.asarray(attitude)
    attitude = compose(registration.rotation, attitude)
    on_platform = compose(nominal_M_P.transpose(0, 2, 1), attitude)
    known = np.isfinite(on_platform).all(axis=(1, 2))
    if not known.any():
        return np.asarray(attitude)
    turned = Rotation.from_matrix(on_platform[known]).mean().as_matrix()
    return np.asarray(compose(attitude, turned.T))


def attitude_registration_columns(tip_columns: FloatArray, nominal_M_P: FloatArray, spread_mm: float) -> FloatArray:
    """(N, 6, Q + 3) derivatives of tip and attitude by the instrument's frame and by the target's turn on the platform.

    tip_columns : (N, 3, Q) of the tip, displacements first, then rotations about x, y, z as in `registration_columns`.
    spread_mm : by which these rotations are divided.
    """
    count, _, own = tip_columns.shape
    columns = np.zeros((count, 6, own + 3))
    columns[:, :3, :own] = tip_columns
    columns[:, 3:, own - 3 : own] = np.eye(3) * MM_PER_RAD / spread_mm
    columns[:, 3:, own:] = nominal_M_P
    return columns
