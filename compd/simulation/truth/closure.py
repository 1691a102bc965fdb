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
from compd.errors import KinematicsError
from compd.simulation.truth.closure_kernels import (
    CLOSED_MM,
    LOST_MM,
    MAX_ITERATIONS,
    PLATFORM_RADIUS_MM,
    close,
    find_forces,
)

# (4, 3): the platform's origin in {M}, mm, and its x, y, z axes in {M}.
Posture = NDArray[np.float64]

_UNIT = np.eye(3)
# Pairs of axes whose products rigidity fixes: the upper triangle of (3, 3), by row, column and place when flat.
_FIRST, _SECOND = np.triu_indices(3)
_UPPER = 3 * _FIRST + _SECOND


def _rigidity_entries() -> NDArray[np.intp]:
    """(6, 12) where the gradient of each product of two axes has its entries: in 0, the axes, the axes twice, flat."""
    entries = np.zeros((6, 4, 3), dtype=np.intp)
    for row, (first, second) in enumerate(zip(_FIRST, _SECOND, strict=True)):
        entries[row, 1 + first] = 1 + 3 * second + np.arange(3)
        entries[row, 1 + second] = 1 + 3 * first + np.arange(3) + (9 if first == second else 0)
    return entries.reshape(6, 12)


_ENTRIES = _rigidity_entries()
_NOTHING = np.zeros(1)
_NO_TIP = np.empty(0)


def homogeneous(points_P: FloatArray) -> FloatArray:
    """(..., 3) places in {P}, mm -> (..., 4) rows; rows @ posture are the places in {M}."""
    rows = np.empty((*points_P.shape[:-1], 4))
    rows[..., 0], rows[..., 1:] = 1.0, points_P
    return rows


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
        self._by_tip = np.einsum("k,cd->ckd", self._row, _UNIT).reshape(3, 12)
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
        self.axes = direction_rows(np.where(on_base[:, None], 0.0, axes))
        self.fixed_M: FloatArray = np.where(on_base[:, None], axes, 0.0)
        self.link_of_axis = link_of_axis
        self._given = axes, on_base

    def with_base_turned(self, turn: FloatArray) -> Closure:
        """The closure with the base's revolute axes turned by a matrix (3, 3) in {M}."""
        axes, on_base = self._given
        if not on_base.any():
            return self
        return Closure(np.where(on_base[:, None], axes @ turn.T, axes), self.link_of_axis, on_base)

    def by_lengths(self, base_M: FloatArray, joints_P: FloatArray, lengths_mm: FloatArray, guess: Posture) -> Posture:
        """The posture in which the links have these lengths.

        base_M, joints_P : (n, 3) joint centres, mm. lengths_mm : (n,). Newton's method from `guess`; raises
        KinematicsError where the links cannot meet.
        """
        return self._closed(base_M, joints_P, _NO_TIP, lengths_mm, guess, "lengths")

    def by_tip(
        self, base_M: FloatArray, joints_P: FloatArray, tip_P: FloatArray, tip_M: FloatArray, guess: Posture
    ) -> Posture:
        """Tripod only: the posture in which the place `tip_P` of the platform is at `tip_M`, (3,) mm each."""
        return self._closed(base_M, joints_P, homogeneous(tip_P), tip_M, guess, "tip")

    def _closed(
        self,
        base_M: FloatArray,
        joints_P: FloatArray,
        tip_row: FloatArray,
        wanted_mm: FloatArray,
        guess: Posture,
        what: str,
    ) -> Posture:
        posture = np.array(guess, order="C")
        base_M, wanted_mm = np.ascontiguousarray(base_M), np.ascontiguousarray(wanted_mm)
        if not close(*self._parts(joints_P), base_M, tip_row, wanted_mm, posture):
            raise _out_of_reach(what, wanted_mm)
        return posture

    def _parts(self, joints_P: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.intp]]:
        """The first arguments of the kernels."""
        return homogeneous(joints_P), self.axes, self.fixed_M, self.link_of_axis

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
        rows, joints = homogeneous(joints_P), _Joints(self, joints_P)
        posture, actuator_mm = guess, guess_mm
        for _ in range(MAX_ITERATIONS):
            base_M, base_by, lengths_mm, lengths_by = moved(actuator_mm)
            lengths, across, gradients = joints.at(posture, base_M)
            wanted, by_posture = target.equations(posture)
            residual = np.concatenate([lengths - lengths_mm, across, wanted, _departure(posture)])
            if _largest(residual) < CLOSED_MM and _is_right_handed(posture):
                return posture, actuator_mm
            directions_M = (rows @ posture - base_M) / lengths[:, None]
            along_by = -np.einsum("nd,ndm->nm", directions_M, base_by) - lengths_by
            axes_M = self.axes @ posture + self.fixed_M
            across_by = -np.einsum("rd,rdm->rm", axes_M, base_by[self.link_of_axis])
            by_actuator = np.concatenate([along_by, across_by, np.zeros((len(wanted) + 6, len(actuator_mm)))])
            gradient = np.concatenate([*gradients(), by_posture, _rigidity(posture)])
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
        load = np.zeros((4, 3))
        for force_M, at_P in loads:
            load += homogeneous(at_P)[:, None] * force_M
        multipliers, lateral_M = load.ravel(), np.zeros(base_M.shape)
        base_M, posture = np.ascontiguousarray(base_M), np.ascontiguousarray(posture)
        if not find_forces(*self._parts(joints_P), base_M, posture, multipliers, lateral_M):
            raise np.linalg.LinAlgError("Singular matrix")
        return multipliers[: len(base_M)], lateral_M


class _Joints:
    """The joints of a closure at any posture, for platform joints (n, 3) that stay where they are in {P}, mm."""

    def __init__(self, closure: Closure, joints_P: FloatArray) -> None:
        self._rows = homogeneous(joints_P)
        self._by_joint = self._rows[:, :, None]
        self._axes, self._fixed_M, self._link = closure.axes, closure.fixed_M, closure.link_of_axis
        self._by_hinge = self._by_joint[self._link]
        self._by_axis = self._axes[:, :, None]

    def at(self, posture: Posture, base_M: FloatArray) -> tuple[FloatArray, FloatArray, Callable[[], list[FloatArray]]]:
        """Link lengths (n,), link components along the revolute axes (r,), and their gradients (n, 12) and (r, 12)."""
        links_M = self._rows @ posture - base_M
        lengths = np.sqrt((links_M * links_M).sum(axis=1))
        axes_M = self._axes @ posture + self._fixed_M
        hinged_M = links_M[self._link]

        def gradients() -> list[FloatArray]:
            along = self._by_joint * (links_M / lengths[:, None])[:, None, :]
            across = self._by_hinge * axes_M[:, None, :] + self._by_axis * hinged_M[:, None, :]
            return [along.reshape(-1, 12), across.reshape(-1, 12)]

        return lengths, (hinged_M * axes_M).sum(axis=1), gradients


def _departure(posture: Posture) -> FloatArray:
    """(6,) departure of the axes from an orthonormal triad, as mm at the platform's radius."""
    axes = posture[1:]
    return PLATFORM_RADIUS_MM * (axes @ axes.T - _UNIT).take(_UPPER)


def _rigidity(posture: Posture) -> FloatArray:
    """(6, 12) gradient of `_departure`."""
    axes = PLATFORM_RADIUS_MM * posture[1:].ravel()
    return np.concatenate([_NOTHING, axes, 2 * axes]).take(_ENTRIES)


def _is_right_handed(posture: Posture) -> bool:
    """Whether it is no mirror image, which a rigid platform cannot reach."""
    (a, b, c), (d, e, f), (g, h, i) = posture[1:].tolist()
    return bool(a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g) > 0)


def _largest(residual: FloatArray) -> float:
    return float(np.maximum.reduce(np.abs(residual)))


def _out_of_reach(what: str, wanted: FloatArray) -> KinematicsError:
    return KinematicsError.of(
        "simulated machine",
        f"the links cannot meet at these {what}",
        value=", ".join(f"{value:.6g}" for value in wanted),
        allowed="a place within reach",
        next_step="ask for a place nearer to machine zero",
    )
