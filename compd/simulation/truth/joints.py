"""Ball joints: runout of the balls' centres as the joints turn, and their elasticity under the links' forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.closure import Posture, homogeneous
from compd.simulation.truth.joint_kernels import add_waves, displace, find_angles
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.strengths import Strengths

# Amplitudes of the first three harmonics of each joint angle, relative to the first: ground balls are smooth.
_HARMONIC_SHARES = np.array([1.0, 0.2, 0.05])
UM = 1e-3


@dataclass(frozen=True)
class Balls:
    """Displacements of the balls' centres from the drawing since machine zero; mm.

    base_along_mm, platform_along_mm : (n,) along the link, positive towards the platform.
    base_across_M, platform_across_P : (n, 3) across the link, which no comparator measures.
    shank_mm : (n,) half the difference of the two reference balls of a revolute joint; no motion of the joint.
    """

    base_along_mm: FloatArray
    base_across_M: FloatArray
    platform_along_mm: FloatArray
    platform_across_P: FloatArray
    shank_mm: FloatArray


class Runout:
    """Runout of n balls: harmonics of the joint's two angles with random phases, zero at machine zero."""

    def __init__(self, joints: int, amplitude_um: FloatArray, rng: np.random.Generator) -> None:
        """`amplitude_um`: (3,) of the first harmonic, along the link and in both directions across."""
        shape = (joints, 3, len(_HARMONIC_SHARES), 2)
        self._phase_rad = rng.uniform(0, 2 * np.pi, shape)
        scatter = rng.uniform(0.5, 1.0, shape)  # from ball to ball
        self._amplitude_mm = scatter * amplitude_um[:, None, None] * UM * _HARMONIC_SHARES[:, None]
        self._at_zero = self._wave(np.zeros((joints, 2)))

    def displacement_mm(self, angles_rad: FloatArray) -> FloatArray:
        """(n, 3) mm for joint angles (n, 2)."""
        return self._wave(angles_rad) - self._at_zero

    @property
    def waves(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Amplitudes, mm, and phases, (n, 3, harmonics, 2) each, and the displacement (n, 3) at machine zero, mm."""
        return self._amplitude_mm, self._phase_rad, self._at_zero

    def _wave(self, angles_rad: FloatArray) -> FloatArray:
        wave_mm = np.zeros((len(angles_rad), 3))
        add_waves(self._amplitude_mm, self._phase_rad, angles_rad, wave_mm)
        return wave_mm


class Joints:
    """All base and platform joints of a machine."""

    def __init__(self, mechanism: Mechanism, strengths: Strengths, rng: np.random.Generator) -> None:
        self._give_mm_per_N = strengths.ball_give_along_um_per_N * UM, strengths.ball_give_across_um_per_N * UM
        self._n = mechanism.links
        directions_M = link_directions(mechanism.joints0_M, homogeneous(mechanism.joints_P) @ mechanism.posture0)
        axes_M = hinge_axes_M(mechanism)
        self._base_triads = triads(directions_M, axes_M)
        self._platform_triads = self._base_triads @ mechanism.posture0[1:].T
        across = strengths.ball_runout_across_share
        amplitude_um = strengths.ball_runout_um * np.array([1.0, across, across])
        self._base = Runout(self._n, amplitude_um, rng)
        self._platform = Runout(self._n, amplitude_um, rng)
        self._shank = Runout(self._n, strengths.shank_eccentricity_um * np.array([1.0, 0.0, 0.0]), rng)

    def balls(self, posture: Posture, directions_M: FloatArray, axial_N: FloatArray, lateral_M: FloatArray) -> Balls:
        """directions_M : (n, 3) as of `link_directions`. axial_N (n,), lateral_M (n, 3) : forces less those at zero."""
        directions_P = directions_M @ posture[1:].T
        # A link in tension pulls its base ball towards the platform, its platform ball towards the base.
        base_along_mm, base_across_M = self._displaced(self._base, self._base_triads, directions_M, axial_N, lateral_M)
        platform_along_mm, platform_across_P = self._displaced(
            self._platform, self._platform_triads, directions_P, -axial_N, -lateral_M @ posture[1:].T
        )
        shank_mm = self._shank.displacement_mm(angles(self._platform_triads, directions_P))[:, 0]
        return Balls(base_along_mm, base_across_M, platform_along_mm, platform_across_P, shank_mm)

    def _displaced(
        self,
        runout: Runout,
        triads: FloatArray,
        directions: FloatArray,
        axial_N: FloatArray,
        lateral_N: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Displacements (n,) along the links and (n, 3) across, mm, of balls with these forces on them."""
        along_mm, across_mm = np.empty(self._n), np.empty((self._n, 3))
        along_mm_per_N, across_mm_per_N = self._give_mm_per_N
        displace(
            triads,
            directions,
            *runout.waves,
            axial_N,
            lateral_N,
            along_mm_per_N,
            across_mm_per_N,
            along_mm,
            across_mm,
        )
        return along_mm, across_mm


def hinge_axes_M(mechanism: Mechanism) -> FloatArray | None:
    """(n, 3) the axis of each link's revolute joint at machine zero; None where not every link has one."""
    if len(mechanism.axes_P) != mechanism.links:
        return None
    axes_M = np.where(mechanism.hinge_on_base[:, None], mechanism.axes_P, mechanism.axes_P @ mechanism.posture0[1:])
    return np.asarray(axes_M[np.argsort(mechanism.link_of_axis)])


def link_directions(base_M: FloatArray, platform_M: FloatArray) -> FloatArray:
    """(n, 3) unit vectors from base to platform joints."""
    links_M = platform_M - base_M
    return np.asarray(links_M / np.sqrt((links_M * links_M).sum(axis=1, keepdims=True)))


def triads(directions: FloatArray, axes: FloatArray | None) -> FloatArray:
    """(n, 3, 3) orthonormal rows: along the link at machine zero, its revolute axis (or any normal), normal to both."""
    if axes is None:
        aside = np.where(np.abs(directions[:, [2]]) > 0.9, [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
        axes = np.cross(directions, aside)
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return np.stack([directions, axes, np.cross(directions, axes)], axis=1)


def angles(axes: FloatArray, directions: FloatArray) -> FloatArray:
    """(n, 2) angles by which links have turned since machine zero; `axes` as from `triads`."""
    turned_rad = np.empty((len(axes), 2))
    find_angles(axes, directions, turned_rad)
    return turned_rad
