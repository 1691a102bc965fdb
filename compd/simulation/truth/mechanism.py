"""The machine as drawn: joint centres, what moves them, posture and link lengths at machine zero."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.configuration import Geometry, ToolOnPlatformSettings
from compd.simulation.truth.closure import Closure, Posture, TargetRows, homogeneous

# Share of a link's length at machine zero by which it, or what moves it, may change either way.
STROKE_SHARE = 0.3


class Mechanism:
    """A `Geometry` as arrays, with its closure; frames by the names' endings.

    n links, m scales. joints0_M: base joints at machine zero; those with the actuators at 0 keep `joint_offsets_B` from
    their supports.
    """

    def __init__(self, geometry: Geometry) -> None:
        base, platform, tool, parts = geometry.base, geometry.platform, geometry.tool, geometry.mechanism
        self.geometry = geometry
        self.links, self.scales = int(geometry.links), geometry.scales
        self.has_frame = geometry.has_frame
        self.origin_B0_M: FloatArray = np.array(base.origin_B0_in_M_mm)
        origin_M = self.origin_B0_M
        self.rotation_M_B0: FloatArray = Rotation.from_rotvec(base.rotation_B0_in_M_rad).as_matrix()
        joints_B = np.array([rod.base_B_mm for rod in parts.rods])
        supports_B = np.array(base.supports_B_mm) if base.supports_B_mm else _triangle_about(joints_B)
        self.supports0_M: FloatArray = origin_M + supports_B @ self.rotation_M_B0.T
        self.support_of_joint: NDArray[np.intp] = np.array(base.support_of_joint or [1] * self.links) - 1
        # (3, n) 1 where a support has a joint
        self.carries: FloatArray = np.eye(3)[:, self.support_of_joint]
        self.joint_offsets_B: FloatArray = joints_B - supports_B[self.support_of_joint]
        self.plate0_M: FloatArray = np.array(geometry.plate_points_M_mm or np.full((3, 3), np.nan))
        self.joints_P: FloatArray = np.array([rod.platform_P_mm for rod in parts.rods])
        self.hinge_on_base: NDArray[np.bool_] = np.array([h.axis_B is not None for h in parts.hinges], dtype=bool)
        self._hinges_on_base = bool(self.hinge_on_base.any())
        self.link_of_axis: NDArray[np.intp] = np.array([h.rod - 1 for h in parts.hinges], dtype=np.intp)
        axes = [h.axis_P if h.axis_B is None else self.rotation_M_B0 @ np.array(h.axis_B) for h in parts.hinges]
        self.axes_P: FloatArray = np.array(axes, dtype=np.float64).reshape(-1, 3)
        self.weight_M: FloatArray = np.array([0.0, 0.0, -platform.weight_N])  # the surface plate is level
        self.weight_at_P: FloatArray = np.array(platform.weight_at_P_mm)
        # Place in {P} that coincides with tip0_M at machine zero: the tool's tip, or the point that it touches.
        on_platform = isinstance(tool, ToolOnPlatformSettings)
        self.tip0_P: FloatArray = np.array(
            tool.at_P_mm if isinstance(tool, ToolOnPlatformSettings) else tool.zero_tip_P_mm
        )
        self.tip0_M: FloatArray = np.array(
            tool.zero_tip_M_mm if isinstance(tool, ToolOnPlatformSettings) else tool.at_M_mm
        )
        self.tip_frame = "M" if on_platform else "P"
        self.fixed: NDArray[np.bool_] = np.array([name in parts.target_fixes for name in "xyzabc"])
        self.scale_of_link: NDArray[np.intp] = np.array([rod.actuator - 1 for rod in parts.rods])
        self.link_of_scale: NDArray[np.intp] = np.array(
            [int(np.flatnonzero(self.scale_of_link == a)[0]) for a in range(self.scales)]
        )
        self._ways = [_Way(actuator) for actuator in parts.actuators]
        self.extended: NDArray[np.bool_] = np.array([self._ways[a].extends for a in self.scale_of_link])
        self.moves_base = not self.extended.all()
        # links that extend one by one, with the platform's hinges on them in order: posture and lengths follow directly
        self.extends_alone = bool(
            self.extended.all()
            and np.array_equal(self.scale_of_link, np.arange(self.links))
            and not self.hinge_on_base.any()
            and np.array_equal(self.link_of_axis, np.arange(len(self.axes_P)))
            and (self.fixed.all() if not len(self.axes_P) else self.fixed.tolist() == [True] * 3 + [False] * 3)
        )
        self._rods_mm: FloatArray = np.array([rod.length_mm for rod in parts.rods])
        self.closure = Closure(self.axes_P, self.link_of_axis, self.hinge_on_base)
        self.still_joints_M: FloatArray = origin_M + joints_B @ self.rotation_M_B0.T
        self._zero_mm: FloatArray = np.zeros(self.scales)
        attitude = Rotation.from_rotvec(tool.zero_rotation_P_in_M_rad).as_matrix()
        if self.extends_alone:
            self.joints0_M = self.still_joints_M
            self.posture0 = self._zero(attitude)
        else:
            guess_mm = np.array([way.guess_mm for way in self._ways])
            posture = np.vstack([self.tip0_M - self.tip0_P @ attitude.T, attitude.T])
            self.posture0, self._zero_mm = self._reach(self.tip0_P, self.tip0_M, attitude.T, posture, guess_mm)
            self.joints0_M = self._moved(self._zero_mm)[0]
        self.lengths0_mm = self.lengths(self.posture0)
        self.stroke_mm: FloatArray = STROKE_SHARE * self.lengths0_mm[self.link_of_scale]

    def lengths(self, posture: Posture) -> FloatArray:
        """(n,) distances between joint centres, all parts as drawn and the actuators as at machine zero."""
        return np.asarray(np.linalg.norm(homogeneous(self.joints_P) @ posture - self.joints0_M, axis=1))

    def scales_at(self, posture: Posture) -> FloatArray:
        """(m,) what scales without an error show at a posture, all parts as drawn."""
        if self.extends_alone:
            return self.lengths(posture) - self.lengths0_mm
        platform_M = homogeneous(self.joints_P) @ posture
        return np.array(
            [
                way.actuator_mm(
                    self.rotation_M_B0.T @ (platform_M[i] - self.still_joints_M[i]), self._rods_mm[i], zero_mm
                )
                - zero_mm
                for way, i, zero_mm in zip(self._ways, self.link_of_scale, self._zero_mm, strict=True)
            ]
        )

    def lengths_at(self, scale_mm: FloatArray) -> FloatArray:
        """(n,) lengths of the links with the actuators at these readings of ideal scales (m,)."""
        if self.extends_alone:
            return self.lengths0_mm + scale_mm
        return self.lengths0_mm + self.extensions(scale_mm)

    def extensions(self, scale_mm: FloatArray) -> FloatArray:
        """(n,) by how much the links are longer where their scales (m,) have moved so far."""
        return np.where(self.extended, scale_mm[self.scale_of_link], 0.0)

    def posture_at(self, tip: FloatArray, turn_rad: FloatArray) -> Posture:
        """Posture as drawn with the tip at `tip`, (3,) in {M}, or in {P} with the tool on the plate.

        turn_rad : rotation vector (3,) in {M} from the attitude at machine zero, where a target has an attitude. What a
        target does not fix follows.
        """
        tip_P, tip_M = (self.tip0_P, tip) if self.tip_frame == "M" else (tip, self.tip0_M)
        axes = self.posture0[1:] @ Rotation.from_rotvec(turn_rad).as_matrix().T
        posture = np.vstack([tip_M - tip_P @ axes, axes])
        if not self.extends_alone:
            return self._reach(tip_P, tip_M, axes, posture, self._zero_mm)[0]
        if len(self.axes_P) == 0:
            return posture
        return self.closure.by_tip(self.joints0_M, self.joints_P, tip_P, tip_M, posture)

    def posture_of(self, scale_mm: FloatArray, guess: Posture) -> Posture:
        """Posture at ideal scales (m,), all parts as drawn; `guess`: one near by."""
        joints_M = self.base_joints_M(self.supports0_M, 0.0, scale_mm) if not self.extends_alone else self.joints0_M
        return self.closure.by_lengths(joints_M, self.joints_P, self.lengths_at(scale_mm), guess)

    def told_pose(self, scale_mm: FloatArray, guess: Posture) -> tuple[FloatArray, FloatArray]:
        """The pose for which a controller without scales drives its actuators to `scale_mm`, all parts as drawn.

        Tip (3,) mm in {B0}, or on the work in {P} where the tool stands on the plate; rotation vector (3,) of {P} in
        {B0}.
        """
        posture = self.posture_of(scale_mm, guess)
        if self.tip_frame == "M":
            tip = (homogeneous(self.tip0_P) @ posture - self.origin_B0_M) @ self.rotation_M_B0
        else:
            tip = posture[1:] @ (self.tip0_M - posture[0])
        return tip, Rotation.from_matrix(self.rotation_M_B0.T @ posture[1:].T).as_rotvec()

    def base_joints_M(
        self, supports_M: FloatArray, stretch: float = 0.0, scale_mm: FloatArray | None = None
    ) -> FloatArray:
        """(n, 3) base joint centres from supports (3, 3); each keeps its offset from its support, in the axes of {B}.

        stretch : relative growth of the offsets.  scale_mm : (m,), where the actuators are.
        """
        axes = self._base_axes(supports_M)
        joints_M: FloatArray = supports_M[self.support_of_joint] + (1 + stretch) * self.joint_offsets_B @ axes
        if scale_mm is None or not self.moves_base:
            return joints_M
        moved_M: FloatArray = joints_M + self._displacements_B(self._zero_mm + scale_mm) @ axes
        return moved_M

    def base_turn(self, supports_M: FloatArray) -> FloatArray:
        """(3, 3) matrix in {M} by which a base on these supports is turned since machine zero."""
        return self._base_axes(supports_M).T @ self._base_axes(self.supports0_M)

    def turned_with_base(self, closure: Closure, supports_M: FloatArray) -> Closure:
        """The closure with the revolute axes of a base that stands on these supports."""
        return closure.with_base_turned(self.base_turn(supports_M)) if self._hinges_on_base else closure

    def _base_axes(self, supports_M: FloatArray) -> FloatArray:
        """(3, 3) the axes of {B} in {M}, as rows."""
        if not self.has_frame:
            return np.asarray(self.rotation_M_B0.T)
        z_M = _cross(supports_M[1] - supports_M[0], supports_M[2] - supports_M[0])
        y_M = supports_M[0] - supports_M.sum(axis=0) / len(supports_M)
        z_M, y_M = z_M / math.sqrt(z_M @ z_M), y_M / math.sqrt(y_M @ y_M)
        return np.array([_cross(y_M, z_M), y_M, z_M])

    def moves_M(self, scale_mm: FloatArray) -> FloatArray:
        """(n, 3) by how much the actuators have moved the base joints since machine zero; scale_mm : (m,)."""
        moved_B = self._displacements_B(self._zero_mm + scale_mm) - self._displacements_B(self._zero_mm)
        return np.where(self.extended[:, None], 0.0, moved_B @ self.rotation_M_B0.T)

    @property
    def kinds(self) -> tuple[str, ...]:
        """(m,) what each actuator does: extends, slides or turns."""
        return tuple(way.kind for way in self._ways)

    @property
    def turned(self) -> FloatArray:
        """(3,) 1 for each turn about x, y, z of {M} that a target fixes, else 0."""
        return self.fixed[3:].astype(np.float64)

    def _displacements_B(self, actuator_mm: FloatArray) -> FloatArray:
        """(n, 3) by how much the actuators move base joints, from where they are at 0."""
        moved = np.array([way.place_B(q) for way, q in zip(self._ways, actuator_mm, strict=True)])
        return moved[self.scale_of_link]

    def _moved(self, actuator_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """What `Closure.by_target` asks: base joints and link lengths at actuators (m,), with their derivatives."""
        joints_M = self.still_joints_M + self._displacements_B(actuator_mm) @ self.rotation_M_B0.T
        speeds = np.array([way.speed_B(q) for way, q in zip(self._ways, actuator_mm, strict=True)])
        own = np.eye(self.scales)[self.scale_of_link]
        joints_by = (speeds[self.scale_of_link] @ self.rotation_M_B0.T)[:, :, None] * own[:, None, :]
        lengths = self._rods_mm + self.extensions(actuator_mm)
        return joints_M, joints_by, lengths, own * self.extended[:, None]

    def _reach(
        self, tip_P: FloatArray, tip_M: FloatArray, axes: FloatArray, guess: Posture, guess_mm: FloatArray
    ) -> tuple[Posture, FloatArray]:
        target = TargetRows(self.fixed, tip_P, tip_M, axes)
        return self.closure.by_target(self._moved, self.joints_P, target, guess, guess_mm)

    def _zero(self, attitude: FloatArray) -> Posture:
        """Posture at machine zero: a hexapod's with its stated attitude; a tripod's follows from its tip, near {B}."""
        axes = attitude.T if len(self.axes_P) == 0 else self.rotation_M_B0.T
        posture = np.vstack([self.tip0_M - self.tip0_P @ axes, axes])
        if len(self.axes_P) == 0:
            return posture
        return self.closure.by_tip(self.joints0_M, self.joints_P, self.tip0_P, self.tip0_M, posture)


class _Way:
    """Where one actuator takes the base joints of its links, in {B}; a turning one counts mm of arc."""

    def __init__(self, actuator: Any) -> None:
        self.kind: str = actuator.kind
        self.extends = actuator.kind == "extends"
        self._radius_mm = getattr(actuator, "radius_mm", 0.0)
        self._cosine_B = np.array(getattr(actuator, "along_B", getattr(actuator, "cosine_B", np.zeros(3))))
        self._sine_B = np.array(getattr(actuator, "sine_B", np.zeros(3)))
        self.guess_mm = getattr(actuator, "zero_rad", 0.0) * self._radius_mm or getattr(actuator, "zero_mm", 1.0)
        if actuator.kind == "turns":
            self.guess_mm = actuator.zero_rad * self._radius_mm

    def place_B(self, actuator_mm: float) -> FloatArray:
        """(3,) from where the joint is at 0, or from the centre of its circle."""
        if not self._radius_mm:
            return np.asarray(actuator_mm * self._cosine_B)
        angle = actuator_mm / self._radius_mm
        return np.asarray(self._radius_mm * (np.cos(angle) * self._cosine_B + np.sin(angle) * self._sine_B))

    def speed_B(self, actuator_mm: float) -> FloatArray:
        """(3,) the derivative of `place_B`."""
        if not self._radius_mm:
            return self._cosine_B
        angle = actuator_mm / self._radius_mm
        return np.asarray(np.cos(angle) * self._sine_B - np.sin(angle) * self._cosine_B)

    def actuator_mm(self, from_joint_B: FloatArray, rod_mm: float, near_mm: float) -> float:
        """Where the actuator is if its rod, from the joint at 0, ends at `from_joint_B` (3,); of two the nearer one."""
        distance_squared = float(from_joint_B @ from_joint_B)
        if self.extends:
            return float(np.sqrt(distance_squared)) - rod_mm
        if not self._radius_mm:
            along = float(from_joint_B @ self._cosine_B)
            root = float(np.sqrt(max(rod_mm**2 - distance_squared + along**2, 0.0)))
            return min(along - root, along + root, key=lambda q: abs(q - near_mm))
        # |v - r (c u + s w)| = L: v.u c + v.w s = (v.v + r^2 - L^2) / 2 r
        u, w = float(from_joint_B @ self._cosine_B), float(from_joint_B @ self._sine_B)
        wanted = (distance_squared + self._radius_mm**2 - rod_mm**2) / (2 * self._radius_mm)
        middle, half = np.arctan2(w, u), np.arccos(np.clip(wanted / np.hypot(u, w), -1.0, 1.0))
        turns = [2 * np.pi * turn for turn in (-1, 0, 1)]
        places = [self._radius_mm * (middle + side * half + turn) for side in (-1, 1) for turn in turns]
        return float(min(places, key=lambda q: abs(q - near_mm)))


def _cross(first: FloatArray, second: FloatArray) -> FloatArray:
    """(3,) vector product of two vectors (3,): `numpy.cross` takes twenty times as long for a single one."""
    (x, y, z), (u, v, w) = first.tolist(), second.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def _triangle_about(joints_B: FloatArray) -> FloatArray:
    """Three places in the plane of the base joints, which carry them where no frame is described."""
    middle = joints_B.mean(axis=0)
    radius = float(np.sqrt(((joints_B - middle) ** 2).sum(axis=1).mean()))
    azimuth = np.deg2rad([90.0, 210.0, 330.0])
    return np.asarray(middle + radius * np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=1))
