"""The machine as drawn: joint centres, posture and link lengths at machine zero."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.configuration import Geometry, ToolOnPlatformSettings
from compd.simulation.truth.closure import Closure, Posture, homogeneous


class Mechanism:
    """A `Geometry` as arrays, with its closure; frames by the names' endings."""

    def __init__(self, geometry: Geometry) -> None:
        base, platform, tool = geometry.base, geometry.platform, geometry.tool
        self.geometry = geometry
        self.links = geometry.links
        origin_M = np.array(base.origin_B0_in_M_mm)
        self.rotation_M_B0: FloatArray = Rotation.from_rotvec(base.rotation_B0_in_M_rad).as_matrix()
        self.supports0_M: FloatArray = origin_M + np.array(base.supports_B_mm) @ self.rotation_M_B0.T
        self.support_of_joint: NDArray[np.intp] = np.array(base.support_of_joint) - 1
        joints_B = np.array(base.joints_B_mm)
        self.joint_offsets_B: FloatArray = joints_B - np.array(base.supports_B_mm)[self.support_of_joint]
        self.joints0_M: FloatArray = origin_M + joints_B @ self.rotation_M_B0.T
        self.plate0_M: FloatArray = np.array(geometry.plate_points_M_mm)
        self.joints_P: FloatArray = np.array(platform.joints_P_mm)
        self.axes_P: FloatArray = np.array(platform.revolute_axes_P).reshape(-1, 3)
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
        self.closure = Closure(self.axes_P)
        self.posture0 = self._zero(Rotation.from_rotvec(tool.zero_rotation_P_in_M_rad).as_matrix())
        self.lengths0_mm = self.lengths(self.posture0)

    def lengths(self, posture: Posture) -> FloatArray:
        """(n,) distances between joint centres, all parts as drawn."""
        return np.asarray(np.linalg.norm(homogeneous(self.joints_P) @ posture - self.joints0_M, axis=1))

    def posture_at(self, tip: FloatArray, turn_rad: FloatArray) -> Posture:
        """Posture as drawn with the tip at `tip`, (3,) in {M}, or in {P} with the tool on the plate.

        turn_rad : hexapod only, rotation vector (3,) in {M} from the attitude at machine zero.
        """
        tip_P, tip_M = (self.tip0_P, tip) if self.tip_frame == "M" else (tip, self.tip0_M)
        axes = self.posture0[1:] @ Rotation.from_rotvec(turn_rad).as_matrix().T
        posture = np.vstack([tip_M - tip_P @ axes, axes])
        if len(self.axes_P) == 0:
            return posture
        return self.closure.by_tip(self.joints0_M, self.joints_P, tip_P, tip_M, posture)

    def base_joints_M(self, supports_M: FloatArray, stretch: float = 0.0) -> FloatArray:
        """(n, 3) base joint centres from supports (3, 3); each keeps its offset from its support, in the axes of {B}.

        stretch : relative growth of the offsets.
        """
        z_M = np.cross(supports_M[1] - supports_M[0], supports_M[2] - supports_M[0])
        y_M = supports_M[0] - supports_M.mean(axis=0)
        z_M, y_M = z_M / np.linalg.norm(z_M), y_M / np.linalg.norm(y_M)
        axes = np.array([np.cross(y_M, z_M), y_M, z_M])
        return np.asarray(supports_M[self.support_of_joint] + (1 + stretch) * self.joint_offsets_B @ axes)

    def _zero(self, attitude: FloatArray) -> Posture:
        """Posture at machine zero: a hexapod's with its stated attitude; a tripod's follows from its tip, near {B}."""
        axes = attitude.T if len(self.axes_P) == 0 else self.rotation_M_B0.T
        posture = np.vstack([self.tip0_M - self.tip0_P @ axes, axes])
        if len(self.axes_P) == 0:
            return posture
        return self.closure.by_tip(self.joints0_M, self.joints_P, self.tip0_P, self.tip0_M, posture)
