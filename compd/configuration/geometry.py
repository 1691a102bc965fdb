"""The machine's geometry as a person writes it: mm, radians, and the frame in every key."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from compd.configuration.section import Number, Positive, Section

# A drawing gives coordinates to 1 nm at best: a frame that misses its convention by more was measured or typed wrongly.
CONVENTION_TOLERANCE_MM = 1e-6


Vector = tuple[Number, Number, Number]


def _unit_vector(vector: Vector) -> Vector:
    """The vector itself; ValueError where its length is not 1."""
    length = math.hypot(*vector)
    if not math.isclose(length, 1.0, abs_tol=1e-6):
        raise ValueError(f"must have length 1, has {length:.9g}")
    return vector


Direction = Annotated[Vector, AfterValidator(_unit_vector)]


class BasePlatform(Section):
    """The base platform: its three supports and the base joints they carry."""

    origin_B0_in_M_mm: Vector = Field(description="origin of {B} at machine zero, in {M}")
    rotation_B0_in_M_rad: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description="rotation vector of {B} at machine zero in {M}; any pose: above, under or beside the work",
    )
    supports_B_mm: tuple[Vector, Vector, Vector] = Field(
        description="frame reference points b1, b2, b3 in {B}: centroid 0, z 0, b1 on +y"
    )
    joints_B_mm: tuple[Vector, ...] = Field(description="base joint centres at machine zero, in {B}, link by link")
    support_of_joint: tuple[Annotated[int, Field(ge=1, le=3)], ...] = Field(
        description="for each base joint the support (1, 2 or 3) that carries it"
    )

    @model_validator(mode="after")
    def _frame_convention(self) -> Self:
        """Check that {B} is the frame of its supports: origin at their centroid, z_B their normal, y_B towards b1."""
        b1, b2, b3 = self.supports_B_mm
        for axis in range(3):
            mean = (b1[axis] + b2[axis] + b3[axis]) / 3
            if abs(mean) > CONVENTION_TOLERANCE_MM:
                raise ValueError(
                    f"supports_B_mm: the centroid must be the origin of {{B}}, its {'xyz'[axis]} is {mean:.6g} mm"
                )
        if max(abs(b[2]) for b in self.supports_B_mm) > CONVENTION_TOLERANCE_MM:
            raise ValueError("supports_B_mm: all three must lie in the plane z = 0 of {B}")
        if abs(b1[0]) > CONVENTION_TOLERANCE_MM or b1[1] <= 0:
            raise ValueError(f"supports_B_mm: b1 must lie on +y, is {list(b1)}")
        if (b2[0] - b1[0]) * (b3[1] - b1[1]) - (b2[1] - b1[1]) * (b3[0] - b1[0]) <= 0:
            raise ValueError("supports_B_mm: (b2-b1) x (b3-b1) must point along +z; exchange b2 and b3")
        if len(self.joints_B_mm) != len(self.support_of_joint):
            raise ValueError(
                f"joints_B_mm has {len(self.joints_B_mm)} entries, support_of_joint {len(self.support_of_joint)}"
            )
        return self


class MovingPlatform(Section):
    """The moving platform: its joints, and the revolute axes of a tripod."""

    joints_P_mm: tuple[Vector, ...] = Field(description="platform joint centres in {P}, link by link")
    revolute_axes_P: tuple[Direction, ...] = Field(
        default=(), description="tripod only: unit vector along each revolute axis, in {P}"
    )
    weight_N: Annotated[float, Field(ge=0, allow_inf_nan=False)] = Field(description="weight of the moving platform")
    weight_at_P_mm: Vector = Field(default=(0.0, 0.0, 0.0), description="where the weight acts, in {P}")


class ToolOnPlatformSettings(Section):
    """The usual arrangement: the tool moves, the work lies on the surface plate."""

    on: Literal["platform"] = Field(description="the moving platform carries the tool")
    at_P_mm: Vector = Field(description="tool tip in {P}")
    zero_tip_M_mm: Vector = Field(description="tool tip in {M} at machine zero")
    zero_rotation_P_in_M_rad: Vector = Field(
        default=(0.0, 0.0, 0.0), description="hexapod only: attitude of {P} in {M} at machine zero, rotation vector"
    )


class ToolOnPlateSettings(Section):
    """Figure 15 of the paper: the tool stands on the surface plate, the work moves."""

    on: Literal["plate"] = Field(description="the surface plate carries the tool")
    at_M_mm: Vector = Field(description="tool tip in {M}")
    zero_tip_P_mm: Vector = Field(description="the place on the work, in {P}, that the tool touches at machine zero")
    zero_rotation_P_in_M_rad: Vector = Field(
        default=(0.0, 0.0, 0.0), description="hexapod only: attitude of {P} in {M} at machine zero, rotation vector"
    )


class Geometry(Section):
    """Everything that the kinematics needs to know about the machine."""

    kinematics: Literal["tripod_3spr", "hexapod_6ups"] = Field(
        description="three links with spherical base joints and revolute platform joints, or six with universal base "
        "joints and spherical platform joints"
    )
    base: BasePlatform = Field(description="the base platform, which carries the base joints")
    platform: MovingPlatform = Field(description="the moving platform")
    tool: Annotated[ToolOnPlatformSettings | ToolOnPlateSettings, Field(discriminator="on")] = Field(
        description="the tool, on the moving platform or on the surface plate"
    )
    plate_points_M_mm: tuple[Vector, Vector, Vector] = Field(description="reference points m1, m2, m3, in {M}")
    link_length_mm: tuple[Positive, Positive] | None = Field(
        default=None, description="shortest and longest length of a link, joint to joint; a target beyond is refused"
    )
    plate_thickness_mm: Positive | None = Field(default=None, description="thickness of the surface plate")
    scale_signal_period_mm: Positive | None = Field(default=None, description="signal period of the linear scales")

    @property
    def links(self) -> int:
        """Number of links: 3 or 6."""
        return 3 if self.kinematics == "tripod_3spr" else 6

    @model_validator(mode="after")
    def _one_entry_per_link(self) -> Self:
        """Check the number of joints and axes against the number of links, and what a tripod cannot have."""
        n = self.links
        counts = {
            "base.joints_B_mm": len(self.base.joints_B_mm),
            "platform.joints_P_mm": len(self.platform.joints_P_mm),
            "platform.revolute_axes_P": len(self.platform.revolute_axes_P),
        }
        needed = {**dict.fromkeys(counts, n), "platform.revolute_axes_P": n if n == 3 else 0}
        wrong = [
            f"{key} has {counts[key]} entries, needs {needed[key]}" for key in counts if counts[key] != needed[key]
        ]
        if wrong:
            raise ValueError(f"{self.kinematics}: " + "; ".join(wrong))
        if self.link_length_mm is not None and self.link_length_mm[0] >= self.link_length_mm[1]:
            raise ValueError(f"link_length_mm: shortest first, then longest, is {list(self.link_length_mm)}")
        if n == 3 and any(self.tool.zero_rotation_P_in_M_rad):
            raise ValueError("tool.zero_rotation_P_in_M_rad: a tripod's attitude follows from its tip; leave it out")
        return self
