"""Where an instrument's target is on the platform, and what of it the attitudes of a recording can show.

A marker body or a reflector with an attitude of its own, at the place d in {P} from the tip, is seen at

    x_M = tip_M + R d.

Several reflectors at different places have a d each, which the sidecar gives; the attitude is then that of the model.

Where the attitude R varies, d is told apart from a displacement of the instrument's frame. The first registration finds
frame and d together, by Gauss and Newton's method; in every fit d has columns of its own, R.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import BoolArray, FloatArray
from compd.comparison.alignment.measured_attitude import measured_attitude, target_turn
from compd.comparison.alignment.registration import Registration, register, registration_columns
from compd.comparison.criteria import ComparisonCriteria
from compd.errors import CompdError
from compd.statistics import MIN_SIGMA, robust_sigma

ROUNDS = 20
# What may be held of a registration, and of which numbers it consists: those of the instrument's frame keep what the
# first registration finds, those of the target are 0: it is at the tip, its axes are those of {P}.
HELD: Mapping[str, frozenset[str]] = {
    "frame": frozenset(f"frame.{name}" for name in "xyzabc"),
    "target": frozenset(f"target.{name}" for name in "xyzabc"),
    "target.place": frozenset(f"target.{name}" for name in "xyz"),
    "target.attitude": frozenset(f"target.{name}" for name in "abc"),
}
# mm: a change of frame and place that is smaller has converged.
_CONVERGED_MM = 1e-6


def held_numbers(names: Iterable[str]) -> frozenset[str]:
    """The numbers of a registration that these names hold. Raises CompdError, with every name that holds none."""
    names = list(names)
    single = HELD["frame"] | HELD["target"]
    if unknown := [name for name in names if name not in HELD and name not in single]:
        raise CompdError.of(
            "hold",
            "is no part of a registration",
            value=", ".join(unknown),
            allowed=", ".join([*HELD, *sorted(single)]),
        )
    return frozenset(number for name in names for number in HELD.get(name, frozenset({name})))


class PlacedTarget(NamedTuple):
    """How the instrument's frame lies in {M}, and where its target is on the platform.

    place_P_mm : (3,), from the tip.  directions_P : (3, K), those along which the rows show a place.
    """

    registration: Registration
    place_P_mm: FloatArray
    directions_P: FloatArray

    def tip_M_mm(self, points_mm: FloatArray, attitude_M_P: FloatArray) -> FloatArray:
        """(N, 3) the tip from points (N, 3) in the instrument's frame and attitudes (N, 3, 3) of {P} in {M}."""
        return target_M_mm(self.registration.into_M(points_mm), attitude_M_P, -self.place_P_mm)


def target_M_mm(tip_M_mm: FloatArray, attitude_M_P: FloatArray, place_P_mm: FloatArray | None) -> FloatArray:
    """(N, 3) where targets are whose place in {P} from the tip is (3,), or (N, 3) of each row; the tip for None."""
    return tip_M_mm if place_P_mm is None else tip_M_mm + np.einsum("...ij,...j", attitude_M_P, place_P_mm)


def target_change(
    tip: FloatArray, rotation: FloatArray, attitude_M_P: FloatArray, place_P_mm: FloatArray
) -> FloatArray:
    """(N, 3, K) changes of such targets (mm) by those of the tip (mm) and of the attitude about axes of {M} (rad).

    tip, rotation : (N, 3, K).  attitude_M_P, place_P_mm : as of `target_M_mm`.
    """
    lever_mm = np.einsum("...ij,...j", attitude_M_P, place_P_mm)
    return np.asarray(tip + np.cross(rotation, lever_mm[..., None], axis=1))


def place_target(
    points_mm: FloatArray,
    rotation_rad: FloatArray,
    tip_M_mm: FloatArray,
    nominal_M_P: FloatArray,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    held: frozenset[str] = frozenset(),
) -> PlacedTarget | None:
    """Frame and place that lay measured points (N, 3) over predicted tips (N, 3), by least squares without outliers.

    rotation_rad : (N, 3), as the instrument shows the target's attitude.  nominal_M_P : (N, 3, 3).
    held : numbers of the target's place that are 0; see `HELD`.
    None where fewer than three rows are left: nothing fixes a frame.
    """
    registration = register(points_mm, tip_M_mm, criteria)
    measured = np.concatenate([points_mm, rotation_rad, tip_M_mm], axis=1)
    known: BoolArray = np.asarray(np.isfinite(measured).all(axis=1))
    if registration is None or not known.any():
        return None
    use = known.copy()
    free = [axis for axis, name in enumerate("xyz") if f"target.{name}" not in held]
    axes: FloatArray = np.eye(3)[:, free]
    directions = np.asarray(axes @ shown_directions(tip_M_mm, nominal_M_P[:, :, free], known, criteria))
    place = np.zeros(3)
    placed = PlacedTarget(registration, place, directions)
    for _ in range(ROUNDS if directions.shape[1] else 0):
        attitude = attitude_M_P(rotation_rad, nominal_M_P, placed.registration)
        residual_mm = tip_M_mm - placed.tip_M_mm(points_mm, attitude)
        size_mm = np.linalg.norm(residual_mm, axis=1)
        limit_mm = criteria.outlier_sigmas * float(robust_sigma(size_mm[use][:, None])[0])
        use = known & (size_mm <= max(limit_mm, MIN_SIGMA))
        frame = registration_columns(tip_M_mm, (0, 1, 2), tip_M_mm[known])
        columns = np.concatenate([frame, np.asarray(-attitude @ directions)], axis=2)
        step, *_ = np.linalg.lstsq(columns[use].reshape(-1, columns.shape[2]), residual_mm[use].ravel(), rcond=None)
        placed = _moved(placed, frame, step, tip_M_mm[known])
        if np.abs(step).max() < _CONVERGED_MM:
            break
    return placed._replace(registration=placed.registration._replace(rows=int(use.sum())))


def attitude_M_P(rotation_rad: FloatArray, nominal_M_P: FloatArray, registration: Registration) -> FloatArray:
    """(N, 3, 3) attitudes of {P} in {M} as they were measured, the target's turn on the platform taken off."""
    return measured_attitude(rotation_rad, registration, target_turn(rotation_rad, nominal_M_P, registration))


def shown_directions(
    tip_M_mm: FloatArray, nominal_M_P: FloatArray, rows: BoolArray, criteria: ComparisonCriteria = ComparisonCriteria()
) -> FloatArray:
    """(A, K) orthonormal directions in {P} along which a place moves what is measured, otherwise than the frame does.

    By the singular values of the place's columns, less what the frame's columns explain.
    nominal_M_P : (N, 3, A), of attitudes those of their axes that are not held.  rows : (N,) those that count.
    """
    axes = nominal_M_P.shape[2]
    if not (axes and rows.any()):
        return np.zeros((axes, 0))
    frame = registration_columns(tip_M_mm, (0, 1, 2), tip_M_mm[rows])[rows].reshape(3 * int(rows.sum()), -1)
    place = nominal_M_P[rows].reshape(-1, axes)
    explained, *_ = np.linalg.lstsq(frame, place, rcond=None)
    _, sizes, directions = np.linalg.svd(place - frame @ explained, full_matrices=False)
    shown: FloatArray = directions[sizes / np.sqrt(len(place)) >= criteria.min_target_motion].T
    return shown


def _moved(placed: PlacedTarget, frame: FloatArray, step: FloatArray, points_M_mm: FloatArray) -> PlacedTarget:
    """Frame and place after a step of the fit: displacements, rotations times the points' spread, then the place."""
    count = frame.shape[2]
    middle_mm = points_M_mm.mean(axis=0)
    spread_mm = float(np.sqrt(np.mean((points_M_mm - middle_mm) ** 2)))
    turn = Rotation.from_rotvec(step[3:count] / spread_mm).as_matrix()
    rotation, translation_mm = placed.registration.rotation, placed.registration.translation_mm
    registration = placed.registration._replace(
        rotation=turn @ rotation, translation_mm=turn @ (translation_mm - middle_mm) + middle_mm + step[:3]
    )
    return placed._replace(registration=registration, place_P_mm=placed.place_P_mm + placed.directions_P @ step[count:])
