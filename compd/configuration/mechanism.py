"""The links of a machine as one description, whichever keys its configuration is written with.

A machine has n rods, m actuators and k = 6 - n hinges. `kinematics: tripod_3spr` and `hexapod_6ups` are short for
actuators that extend one rod each; every other machine states `actuators`, `rods`, `hinges` and `target_fixes`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

from pydantic import Field

from compd.configuration.vectors import Direction, Vector
from compd.documents import Finite, Positive, Section

Coordinate: TypeAlias = Literal["x", "y", "z", "a", "b", "c"]
COORDINATES: tuple[Coordinate, ...] = ("x", "y", "z", "a", "b", "c")


class ExtendingActuator(Section):
    """An actuator that makes its rods longer."""

    kind: Literal["extends"] = Field(description="the length of each of its rods is `length_mm` and the actuator")


class SlidingActuator(Section):
    """An actuator that moves the base joints of its rods along a line."""

    kind: Literal["slides"] = Field(description="its rods' base joints are `base_B_mm` + actuator x `along_B`")
    along_B: Direction = Field(description="unit vector in {B} of its way")
    zero_mm: Finite = Field(default=0.0, description="about where it stands at machine zero")


class TurningActuator(Section):
    """An actuator that moves the base joints of its rods around a circle."""

    kind: Literal["turns"] = Field(
        description="its rods' base joints are `base_B_mm` + `radius_mm` (cos `cosine_B` + sin `sine_B`)"
    )
    radius_mm: Positive = Field(description="of the circle; its scale counts mm of arc, radius times angle")
    cosine_B: Direction = Field(description="unit vector in {B} from the centre to the joint at angle 0")
    sine_B: Direction = Field(description="unit vector in {B} from the centre to the joint at a right angle")
    zero_rad: Finite = Field(default=0.0, description="about where it stands at machine zero")


Actuator = Annotated[ExtendingActuator | SlidingActuator | TurningActuator, Field(discriminator="kind")]


class Rod(Section):
    """A link: a rod between base and platform."""

    actuator: Annotated[int, Field(ge=1)] = Field(description="the actuator that moves it, from 1")
    base_B_mm: Vector = Field(
        description="base joint centre in {B}, with the actuator at 0; centre of the circle of one that turns"
    )
    platform_P_mm: Vector = Field(description="platform joint centre in {P}")
    length_mm: Annotated[float, Field(ge=0, allow_inf_nan=False)] = Field(
        default=0.0, description="between its joints; of a rod that is extended, its length at actuator 0"
    )


class Hinge(Section):
    """A revolute joint: the rod stays square to its axis."""

    rod: Annotated[int, Field(ge=1)] = Field(description="the rod that it holds, from 1")
    axis_P: Direction | None = Field(default=None, description="unit vector along the axis, fixed to the platform")
    axis_B: Direction | None = Field(default=None, description="unit vector along the axis, fixed to the base")


class MechanismDescription(NamedTuple):
    """The links of a machine.

    actuators : m of them.  rods : n.  hinges : k = 6 - n.
    target_fixes : the m coordinates that a target fixes: x, y, z of the tip, turns a, b, c about x, y, z of {M}.
    """

    actuators: tuple[Any, ...]
    rods: tuple[Rod, ...]
    hinges: tuple[Hinge, ...]
    target_fixes: tuple[Coordinate, ...]


def described(geometry: Any) -> MechanismDescription:
    """The links of a checked geometry, from either of its forms."""
    if geometry.rods:
        return MechanismDescription(geometry.actuators, geometry.rods, geometry.hinges, geometry.target_fixes)
    base, platform = geometry.base, geometry.platform
    ends = zip(base.joints_B_mm, platform.joints_P_mm, strict=True)
    rods = tuple(
        Rod(actuator=i, base_B_mm=joint_B, platform_P_mm=joint_P) for i, (joint_B, joint_P) in enumerate(ends, start=1)
    )
    hinges = tuple(Hinge(rod=i, axis_P=axis) for i, axis in enumerate(platform.revolute_axes_P, start=1))
    return MechanismDescription(
        (ExtendingActuator(kind="extends"),) * len(rods),
        rods,
        hinges,
        COORDINATES if len(rods) == 6 else ("x", "y", "z"),
    )
