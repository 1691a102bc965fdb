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


class TargetRows:
    """The coordinates that a target fixes: x, y, z of the tip, and turns about x, y, z of {M}.

    With the axes w_j of the attitude wanted, sum_j w_j x (axis j) / 2 is the sine of the angle between the two
    attitudes, along the axis about which they differ.
    """

    def __init__(self, fixed: NDArray[np.bool_], tip_P: FloatArray, tip_M: FloatArray, axes: FloatArray) -> None:
        """fixed : (6,).  tip_P, tip_M : (3,) the place of the platform, and where it is to be.  axes : (3, 3), rows."""
        self.tip_M = tip_M
        self._fixed, self._row, self._axes = fixed, homogeneous(tip_P), axes
        self._by_tip = np.einsum("k,cd->ckd", self._row, np.eye(3)).reshape(3, 12)
        by_turn = np.zeros((3, 4, 3))
        for j in range(3):
            x, y, z = PLATFORM_RADIUS_MM / 2 * axes[j]
            by_turn[:, 1 + j] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]  # w x
        self._by_turn = by_turn.reshape(3, 12)

    def equations(self, posture: Posture) -> tuple[FloatArray, FloatArray]:
        """(m,) what is left, mm, and (m, 12) its gradient."""
        turned = PLATFORM_RADIUS_MM / 2 * np.cross(self._axes, posture[1:]).sum(axis=0)
        left = np.concatenate([self._row @ posture - self.tip_M, turned])
        return left[self._fixed], np.concatenate([self._by_tip, self._by_turn])[self._fixed]


class Closure:
    """Closure of n links and 6 - n revolute joints, each of which keeps its link square to an axis."""

    def __init__(self, axes: FloatArray, link_of_axis: NDArray[np.intp], on_base: NDArray[np.bool_]) -> None:
        """`axes`: (r, 3) unit vectors of the revolute joints, in {P}, or in {M} where `on_base` (r,).

        link_of_axis : (r,), from 0.
        """
        # an axis of the base does not move with the platform: its row is 0, and it is added in {M}
        self._axes = direction_rows(np.where(on_base[:, None], 0.0, axes))
        self._fixed_M: FloatArray = np.where(on_base[:, None], axes, 0.0)
        self._link = link_of_axis
        self._given = axes, on_base

    def with_base_turned(self, turn: FloatArray) -> Closure:
        """The closure with the base's revolute axes turned by a matrix (3, 3) in {M}."""
        axes, on_base = self._given
        if not on_base.any():
            return self
        return Closure(np.where(on_base[:, None], axes @ turn.T, axes), self._link, on_base)

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

    def by_target(
        self,
        moved: Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray, FloatArray]],
        joints_P: FloatArray,
        target: TargetRows,
        guess: Posture,
        guess_mm: FloatArray,
    ) -> tuple[Posture, FloatArray]:
        """The posture and the actuators (m,) that bring the platform to what a target fixes, m equations.

        moved : from actuators (m,) to the base joints (n, 3), their derivatives (n, 3, m), the links' lengths (n,) and
            theirs (n, m).
        """
        rows = homogeneous(joints_P)
        posture, actuator_mm = guess, guess_mm
        for _ in range(MAX_ITERATIONS):
            base_M, base_by, lengths_mm, lengths_by = moved(actuator_mm)
            along, across = self._joints(posture, base_M, rows)
            directions_M = (rows @ posture - base_M) / along[0][:, None]
            wanted, by_posture = target.equations(posture)
            departure, rigid = _rigidity(posture)
            residual = np.concatenate([along[0] - lengths_mm, across[0], wanted, departure])
            if np.abs(residual).max() < CLOSED_MM and np.linalg.det(posture[1:]) > 0:
                return posture, actuator_mm
            along_by = -np.einsum("nd,ndm->nm", directions_M, base_by) - lengths_by
            axes_M = self._axes @ posture + self._fixed_M
            across_by = -np.einsum("rd,rdm->rm", axes_M, base_by[self._link])
            by_actuator = np.concatenate([along_by, across_by, np.zeros((len(wanted) + 6, len(actuator_mm)))])
            gradient = np.concatenate([along[1], across[1], by_posture, rigid])
            try:
                step = np.linalg.solve(np.concatenate([gradient, by_actuator], axis=1), residual)
            except np.linalg.LinAlgError:
                break
            if not np.abs(step).max() < LOST_MM:
                break
            posture, actuator_mm = posture - step[:12].reshape(4, 3), actuator_mm - step[12:]
        raise _out_of_reach("target", target.tip_M)

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
        np.add.at(lateral_M, self._link, lateral[:, None] * (self._axes @ posture + self._fixed_M))
        return multipliers[:n], lateral_M

    def _joints(
        self, posture: Posture, base_M: FloatArray, rows: FloatArray
    ) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
        """Link lengths (n,) and gradient (n, 12); link components along the revolute axes (r,) and gradient (r, 12)."""
        links_M = rows @ posture - base_M
        lengths = np.sqrt((links_M * links_M).sum(axis=1))
        along = (rows[:, :, None] * (links_M / lengths[:, None])[:, None, :]).reshape(-1, 12)
        axes_M = self._axes @ posture + self._fixed_M
        hinged_M = links_M[self._link]
        across = rows[self._link][:, :, None] * axes_M[:, None, :] + self._axes[:, :, None] * hinged_M[:, None, :]
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
    raise _out_of_reach(what, wanted)


def _out_of_reach(what: str, wanted: FloatArray) -> KinematicsError:
    return KinematicsError(
        Problem(
            where="simulated machine",
            what=f"the links cannot meet at these {what}",
            value=", ".join(f"{value:.6g}" for value in wanted),
            allowed="a place within reach",
            next_step="ask for a place nearer to machine zero",
        )
    )
