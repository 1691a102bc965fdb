"""The mechanism's closure in natural coordinates, and the forces in it as the constraints' multipliers.

The platform is an origin and three axis vectors in {M}, twelve numbers (J. Garcia de Jalon, E. Bayo,
Kinematic and Dynamic Simulation of Multibody Systems, 1994, chapter 2). Rigidity, link lengths and
revolute joints are then polynomials of degree two at most, no angle appears anywhere, and the
constraints' multipliers in static equilibrium are the joint forces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from compd.arrays import FloatArray
from compd.errors import KinematicsError, Problem

# (4, 3): the platform's origin in {M}, mm, and its x, y, z axes in {M}.
Posture = NDArray[np.float64]

# Tolerance: far below every physical cause (nm), far above rounding at 1 m (1e-13 mm).
CLOSED_MM = 1e-11
MAX_ITERATIONS = 25
# Newton's method has diverged.
LOST_MM = 1e5
# Weights errors of the axes: as the millimetres that they displace at this radius.
PLATFORM_RADIUS_MM = 100.0
_FIRST, _SECOND = np.triu_indices(3)


def homogeneous(points_P: FloatArray) -> FloatArray:
    """(..., 3) places in {P}, mm -> (..., 4) rows; rows @ posture are the places in {M}."""
    return np.concatenate([np.ones((*points_P.shape[:-1], 1)), points_P], axis=-1)


def direction_rows(axes_P: FloatArray) -> FloatArray:
    """(..., 3) directions in {P} -> (..., 4) rows; rows @ posture are the directions in {M}."""
    return np.concatenate([np.zeros((*axes_P.shape[:-1], 1)), axes_P], axis=-1)


class Closure:
    """Closure of a 3-SPR tripod (three revolute axes) or a 6-UPS hexapod (none)."""

    def __init__(self, axes_P: FloatArray) -> None:
        """`axes_P`: (3, 3) unit vectors of the revolute joints, or (0, 3)."""
        self._axes = direction_rows(axes_P)

    def by_lengths(self, base_M: FloatArray, joints_P: FloatArray, lengths_mm: FloatArray, guess: Posture) -> Posture:
        """The posture in which the links have these lengths.

        base_M, joints_P : (n, 3) joint centres, mm. lengths_mm : (n,). Newton's method from `guess`; raises
        KinematicsError where the links cannot meet.
        """
        rows = homogeneous(joints_P)

        def equations(posture: Posture) -> tuple[FloatArray, FloatArray]:
            along, across = self._joints(posture, base_M, rows)
            return np.concatenate([along[0] - lengths_mm, across[0]]), np.concatenate([along[1], across[1]])

        return _newton(equations, guess, "lengths", lengths_mm)

    def by_tip(
        self, base_M: FloatArray, joints_P: FloatArray, tip_P: FloatArray, tip_M: FloatArray, guess: Posture
    ) -> Posture:
        """Tripod only: the posture in which the place `tip_P` of the platform is at `tip_M`, (3,) mm each."""
        rows = homogeneous(joints_P)
        tip_row = homogeneous(tip_P)
        gradient = np.einsum("k,cd->ckd", tip_row, np.eye(3)).reshape(3, 12)

        def equations(posture: Posture) -> tuple[FloatArray, FloatArray]:
            _, across = self._joints(posture, base_M, rows)
            return np.concatenate([tip_row @ posture - tip_M, across[0]]), np.concatenate([gradient, across[1]])

        return _newton(equations, guess, "tip", tip_M)

    def forces(
        self, posture: Posture, base_M: FloatArray, joints_P: FloatArray, loads: Sequence[tuple[FloatArray, FloatArray]]
    ) -> tuple[FloatArray, FloatArray]:
        """Link forces in static equilibrium with `loads`, pairs of a force in {M}, N, and its place in {P}, mm.

        Solves gradient(constraints)^T multipliers = generalised load.

        Returns axial (n,), N, tension positive, and (n, 3) the lateral force in {M}, N, that each link's
        base ball takes from the link (tripod: along its revolute axis; hexapod: none).
        """
        along, across = self._joints(posture, base_M, homogeneous(joints_P))
        _, rigid = _rigidity(posture)
        generalised = sum((np.outer(homogeneous(at_P), force_M) for force_M, at_P in loads), np.zeros((4, 3)))
        gradients = np.concatenate([along[1], across[1], rigid])
        multipliers = np.linalg.solve(gradients.T, generalised.ravel())
        n = len(base_M)
        lateral = multipliers[n : n + len(self._axes)]
        lateral_M = np.zeros((n, 3))
        lateral_M[: len(lateral)] = lateral[:, None] * (self._axes @ posture)
        return multipliers[:n], lateral_M

    def _joints(
        self, posture: Posture, base_M: FloatArray, rows: FloatArray
    ) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
        """Link lengths (n,) and gradient (n, 12); link components along the revolute axes (r,) and gradient (r, 12)."""
        links_M = rows @ posture - base_M
        lengths = np.sqrt((links_M * links_M).sum(axis=1))
        along = (rows[:, :, None] * (links_M / lengths[:, None])[:, None, :]).reshape(-1, 12)
        axes_M = self._axes @ posture
        hinged_M = links_M[: len(axes_M)]
        across = rows[: len(axes_M), :, None] * axes_M[:, None, :] + self._axes[:, :, None] * hinged_M[:, None, :]
        return (lengths, along), ((hinged_M * axes_M).sum(axis=1), across.reshape(-1, 12))


def _rigidity(posture: Posture) -> tuple[FloatArray, FloatArray]:
    """Departure of the axes from an orthonormal triad (6,), as mm at the platform's radius; gradient (6, 12)."""
    axes = posture[1:]
    departure = (axes @ axes.T - np.eye(3))[_FIRST, _SECOND]
    gradient = np.zeros((6, 4, 3))
    rows = np.arange(6)
    gradient[rows, 1 + _FIRST] += axes[_SECOND]
    gradient[rows, 1 + _SECOND] += axes[_FIRST]
    return PLATFORM_RADIUS_MM * departure, PLATFORM_RADIUS_MM * gradient.reshape(6, 12)


def _newton(
    equations: Callable[[Posture], tuple[FloatArray, FloatArray]], guess: Posture, what: str, wanted: FloatArray
) -> Posture:
    """The posture at which `equations`, together with rigidity, vanish. `what`, `wanted`: for the error's text."""
    posture = guess
    for _ in range(MAX_ITERATIONS):
        error, gradient = equations(posture)
        departure, rigid = _rigidity(posture)
        residual = np.concatenate([error, departure])
        largest_mm = np.abs(residual).max()
        if largest_mm > LOST_MM:
            break
        if largest_mm < CLOSED_MM:
            if np.linalg.det(posture[1:]) < 0:
                break  # the mirror image, which a rigid platform cannot reach
            return posture
        try:
            step = np.linalg.solve(np.concatenate([gradient, rigid]), residual)
        except np.linalg.LinAlgError:
            break
        posture = posture - step.reshape(4, 3)
    raise KinematicsError(
        Problem(
            where="simulated machine",
            what=f"the links cannot meet at these {what}",
            value=", ".join(f"{value:.6g}" for value in wanted),
            allowed="a place within reach",
            next_step="ask for a place nearer to machine zero",
        )
    )
