r"""Distances between points, equal in every frame: how well an instrument's points fit a machine's places.

Where the instrument stands and how it is turned is not known before the points are joined. The distances
:math:`|q_j - q_l|` between its points do not depend on it, and must be those between the places
:math:`|p_i - p_k|` that the machine's kinematics expects. Of lengths along one line the signed differences take the
part of the distances. Mirrored points have the same distances; a right-handed frame cannot be laid over them, which
`lay_over` shows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray, IntArray, rms

# Largest rms error (mm) of distances. compd's library has 0.1 mm as the limit for one joint after machining and
# assembly (`base_joint`, `platform_joint`), and 1 mm for the rest of two registered frames (`reference`). A larger
# error means another geometry than that of the configuration, or other points.
MAX_RMS_MM = 1.0
# The same as a share of the distances' own rms: any points would fit among places this near to each other.
MAX_SHARE = 0.05
# Least rms of the points across their best line, as a share of that along it: less fixes no frame.
MIN_WIDTH = 0.01
# Up to this many points all pairs are compared; of more points, the pairs at these distances in order.
_ALL_PAIRS = 200
_LAGS = (1, 2, 3, 5, 8, 13, 21, 34, 55, 89, 144, 233, 377)


@dataclass(frozen=True)
class RigidMotion:
    """Registration of the instrument's points to the machine's: turned (d, d), then moved by moved_mm (d,)."""

    turned: FloatArray
    moved_mm: FloatArray

    def __call__(self, measured_mm: FloatArray) -> FloatArray:
        """(N, d) points of the instrument's frame in that of the machine."""
        return np.asarray(measured_mm @ self.turned.T + self.moved_mm)


def lay_over(measured_mm: FloatArray, expected_mm: FloatArray) -> RigidMotion:
    """The rotation and displacement, of lengths (d = 1) the displacement, from measured (N, d) to expected (N, d).

    By least squares (W. Kabsch, Acta Cryst. A32 (1976) 922), never a mirror image.
    """
    centre, expected_centre = measured_mm.mean(axis=0), expected_mm.mean(axis=0)
    if measured_mm.shape[1] == 1:
        turned = np.eye(1)
    else:
        with np.errstate(all="ignore"):
            rotation, _ = Rotation.align_vectors(expected_mm - expected_centre, measured_mm - centre)
        turned = rotation.as_matrix()
    return RigidMotion(turned, np.asarray(expected_centre - turned @ centre))


def pairs_of(count: int) -> tuple[IntArray, IntArray]:
    """Numbers (P,), (P,) of the points of each pair whose distance counts: all pairs, of many points those by _LAGS."""
    if count <= _ALL_PAIRS:
        first, second = np.triu_indices(count, 1)
        return first.astype(np.int64), second.astype(np.int64)
    lags = [lag for lag in _LAGS if lag < count]
    first = np.concatenate([np.arange(count - lag) for lag in lags])
    second = np.concatenate([np.arange(lag, count) for lag in lags])
    return first.astype(np.int64), second.astype(np.int64)


def separation_mm(first_mm: FloatArray, second_mm: FloatArray) -> FloatArray:
    """(...) distances of points (..., 3), or signed differences of lengths (..., 1)."""
    difference = second_mm - first_mm
    return np.asarray(difference[..., 0] if difference.shape[-1] == 1 else np.linalg.norm(difference, axis=-1))


def distances_rms_mm(expected_mm: FloatArray, measured_mm: FloatArray) -> float:
    """Root mean square of the differences of distances between points (N, d); nan for fewer than two."""
    first, second = pairs_of(len(expected_mm))
    expected = separation_mm(expected_mm[first], expected_mm[second])
    return rms(separation_mm(measured_mm[first], measured_mm[second]) - expected)


def largest_rms_mm(expected_mm: FloatArray) -> float:
    """Limit of the rms of the distances between these points (N, d)."""
    first, second = pairs_of(len(expected_mm))
    spread_mm = rms(separation_mm(expected_mm[first], expected_mm[second]))
    return min(MAX_RMS_MM, MAX_SHARE * spread_mm)


def is_spread(expected_mm: FloatArray) -> bool:
    """Whether points (N, d) fix a frame: three or more that are not on one line; of lengths, three different ones."""
    if len(expected_mm) < 3:
        return False
    values = np.linalg.svd(expected_mm - expected_mm.mean(axis=0), compute_uv=False)
    if expected_mm.shape[1] == 1:
        return bool(len(np.unique(np.round(expected_mm, 2))) >= 3)
    return bool(values[1] > max(MIN_WIDTH * values[0], 1e-3))
