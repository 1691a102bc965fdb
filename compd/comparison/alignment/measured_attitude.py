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
from compd.display_unit import MM_PER_RAD
from compd.rotation import compose, rotation_matrix, rotation_vector


def attitude_mm(rotation_M_P: FloatArray, nominal_M_P: FloatArray) -> FloatArray:
    """(N, 3) the rotation vector from nominal attitudes (N, 3, 3) to others, one urad counted as a um."""
    with np.errstate(invalid="ignore"):  # rows without an attitude stay nan
        return np.asarray(rotation_vector(compose(rotation_M_P, nominal_M_P.transpose(0, 2, 1)))) * MM_PER_RAD


def target_turn(
    rotation_rad: FloatArray, nominal_M_P: FloatArray, registration: Registration | None
) -> FloatArray | None:
    """(3, 3) how an instrument's target is turned on the platform: the mean over all rows that have both attitudes.

    Arguments as of `measured_attitude`.  None for attitudes of {P} in {M}, and where no row has both.
    """
    if registration is None:
        return None
    attitude = compose(registration.rotation, rotation_matrix(rotation_rad))
    on_platform = compose(nominal_M_P.transpose(0, 2, 1), attitude)
    known = np.isfinite(on_platform).all(axis=(1, 2))
    return Rotation.from_matrix(on_platform[known]).mean().as_matrix() if known.any() else None


def measured_attitude(
    rotation_rad: FloatArray, registration: Registration | None, turn: FloatArray | None
) -> FloatArray:
    """(N, 3, 3) attitudes in {M} from rotation vectors (N, 3) as they were measured.

    registration : of the instrument's frame; None for attitudes of {P} in {M}.  turn : (3, 3) of the `target_turn`: in
    its own frame an instrument knows its target's attitude, not that of {P}.
    """
    attitude = rotation_matrix(rotation_rad)
    if registration is not None:
        attitude = compose(registration.rotation, attitude)
    return np.asarray(attitude if turn is None else compose(attitude, turn.T))


def attitude_registration_columns(
    tip_columns: FloatArray, place_columns: FloatArray, nominal_M_P: FloatArray, spread_mm: float
) -> FloatArray:
    """(N, 6, Q + K + 3) derivatives of tip and attitude by the instrument's frame, and by the place and the turn of its
    target on the platform.

    tip_columns : (N, 3, Q) of the tip, displacements first, then rotations about x, y, z as in `registration_columns`.
    place_columns : (N, 3, K) of the tip.  spread_mm : by which the rotations are divided.
    """
    count, _, own = tip_columns.shape
    turn = own + place_columns.shape[2]
    columns = np.zeros((count, 6, turn + 3))
    columns[:, :3, :own] = tip_columns
    columns[:, :3, own:turn] = place_columns
    columns[:, 3:, own - 3 : own] = np.eye(3) * MM_PER_RAD / spread_mm
    columns[:, 3:, turn:] = nominal_M_P
    return columns
