"""Where the tool is: on the moving platform, or fixed on the surface plate with the work moving (paper, figure 15).

Either way the machine closes in one contact, p + R tip_P = tip_M. Which side of it is fixed, what a target means and
what a measurement gives depends on the arrangement; everybody else asks it by the methods that both arrangements have.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from compd.arrays import FloatArray
from compd.model.kinematics.frame import FrameGeometry
from compd.model.kinematics.link_kinematics import Pose
from compd.rotation import to_inner, to_outer


class Contact(NamedTuple):
    """One place, in two frames: tip_M_mm (..., 3) in {M}, tip_P_mm (..., 3) in {P}."""

    tip_M_mm: FloatArray
    tip_P_mm: FloatArray


@dataclass(frozen=True, eq=False)
class ToolOnPlatform:
    """The tool moves, the work lies on the surface plate: a target is a place in {B0}.

    tool_P_mm : (..., 3), the tip in {P}.
    """

    on_plate: ClassVar[bool] = False
    tool_P_mm: FloatArray

    @property
    def tool_mm(self) -> FloatArray:
        """The tool's own vector (..., 3), here in {P}: what the port `tool` is added to."""
        return self.tool_P_mm

    def target_contact(self, frame: FrameGeometry, target_B0_mm: ArrayLike) -> Contact:
        """The contact that puts the tip on the target (..., 3), which keeps its place on the surface plate."""
        return Contact(to_outer(frame.zero_rotation_M_B, frame.zero_origin_M_mm, target_B0_mm), self.tool_P_mm)

    def contact_at(self, pose: Pose, tool_mm: FloatArray | None = None) -> Contact:
        """Where the tip is when the platform is at `pose`, p + R tool; tool_mm (..., 3) takes the place of the tool."""
        tool_mm = self.tool_P_mm if tool_mm is None else tool_mm
        return Contact(to_outer(pose.rotation_M_P, pose.origin_M_mm, tool_mm), tool_mm)

    def with_tool(self, contact: Contact, tool_mm: FloatArray) -> Contact:
        """The same place of the tip in {M}, reached with another tool tool_mm (..., 3)."""
        return Contact(contact.tip_M_mm, tool_mm)

    def force_on_tool_N(self, force_M_N: FloatArray, rotation_M_P: FloatArray) -> FloatArray:
        """The force (..., 3) on the tool's tip, in the frame of `tool_mm`: R^T F, for the platform carries the tool.

        force_M_N : (..., 3), the external force F on what the platform carries.  rotation_M_P : (..., 3, 3).
        """
        return np.asarray((rotation_M_P * force_M_N[..., :, None]).sum(axis=-2))

    def measured_tip_mm(self, contact: Contact) -> FloatArray:
        """The tip (..., 3) in the frame in which this arrangement measures, {M}."""
        return contact.tip_M_mm


@dataclass(frozen=True, eq=False)
class ToolOnPlate:
    """The tool stands on the surface plate, the work moves: a target is a place on the work, in {P}.

    tool_M_mm : (..., 3), the tip in {M}.
    """

    on_plate: ClassVar[bool] = True
    tool_M_mm: FloatArray

    @property
    def tool_mm(self) -> FloatArray:
        """The tool's own vector (..., 3), here in {M}: what the port `tool` is added to."""
        return self.tool_M_mm

    def target_contact(self, frame: FrameGeometry, target_P_mm: ArrayLike) -> Contact:
        """The contact that brings the target (..., 3) on the work to the tool, wherever {B} is."""
        return Contact(self.tool_M_mm, target_P_mm)  # type: ignore[arg-type]

    def contact_at(self, pose: Pose, tool_mm: FloatArray | None = None) -> Contact:
        """The place on the work that the tool touches at `pose`, R^T (tool - p); tool_mm (..., 3) takes its place."""
        tool_mm = self.tool_M_mm if tool_mm is None else tool_mm
        return Contact(tool_mm, to_inner(pose.rotation_M_P, pose.origin_M_mm, tool_mm))

    def with_tool(self, contact: Contact, tool_mm: FloatArray) -> Contact:
        """The same place on the work, touched with another tool tool_mm (..., 3)."""
        return Contact(tool_mm, contact.tip_P_mm)

    def force_on_tool_N(self, force_M_N: FloatArray, rotation_M_P: FloatArray) -> FloatArray:
        """The force (..., 3) on the tool's tip, in the frame of `tool_mm`: -F, for the platform carries the work.

        force_M_N : (..., 3), the external force F on what the platform carries, here by the tool on the work; the work
        presses back on the tool.  rotation_M_P : (..., 3, 3), of no influence: tool and force are both in {M}.
        """
        return np.asarray(-force_M_N)

    def measured_tip_mm(self, contact: Contact) -> FloatArray:
        """The tip (..., 3) in the frame in which this arrangement measures: the place on the work, in {P}."""
        return contact.tip_P_mm


Arrangement: TypeAlias = ToolOnPlatform | ToolOnPlate
