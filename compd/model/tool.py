"""Where the tool is: on the moving platform, or fixed on the surface plate with the work moving (figure 15).

Either way the machine closes in one contact, p + R tip_P = tip_M. What differs is which side of it is fixed, what a
target says, and what a measurement finds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from numpy.typing import ArrayLike

from compd.arrays import FloatArray
from compd.model.frame import FrameGeometry
from compd.model.kinematics import Pose
from compd.model.transform import to_inner, to_outer


class Contact(NamedTuple):
    """One place, in two frames: tip_M_mm (..., 3) in {M}, tip_P_mm (..., 3) in {P}."""

    tip_M_mm: FloatArray
    tip_P_mm: FloatArray


@dataclass(frozen=True, eq=False)
class ToolOnPlatform:
    """The tool moves, the work lies on the surface plate: a target is a place in {B0}.

    tool_P_mm : (..., 3), the tip in {P}.
    """

    tool_P_mm: FloatArray

    def target_contact(self, frame: FrameGeometry, target_B0_mm: ArrayLike) -> Contact:
        """The contact that puts the tip on the target (..., 3); it keeps its place on the surface plate."""
        return Contact(to_outer(frame.zero_rotation_M_B, frame.zero_origin_M_mm, target_B0_mm), self.tool_P_mm)

    def contact_at(self, pose: Pose) -> Contact:
        """Where the tip is when the platform is at `pose`."""
        return Contact(to_outer(pose.rotation_M_P, pose.origin_M_mm, self.tool_P_mm), self.tool_P_mm)


@dataclass(frozen=True, eq=False)
class ToolOnPlate:
    """The tool stands on the surface plate, the work moves: a target is a place on the work, in {P}.

    tool_M_mm : (..., 3), the tip in {M}.
    """

    tool_M_mm: FloatArray

    def target_contact(self, frame: FrameGeometry, target_P_mm: ArrayLike) -> Contact:
        """The contact that brings the target (..., 3) on the work to the tool, wherever {B} is."""
        return Contact(self.tool_M_mm, target_P_mm)  # type: ignore[arg-type]

    def contact_at(self, pose: Pose) -> Contact:
        """The place on the work that the tool touches when the platform is at `pose`: R^T (tool - p)."""
        return Contact(self.tool_M_mm, to_inner(pose.rotation_M_P, pose.origin_M_mm, self.tool_M_mm))


Arrangement: TypeAlias = ToolOnPlatform | ToolOnPlate
