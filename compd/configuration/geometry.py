"""The machine's geometry in the configuration: mm, radians, and the frame in every key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

from pydantic import Field

from compd.configuration.vectors import Direction, Vector
from compd.documents import Finite, Location, Positive, Section
from compd.link_count import LinkCount

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
    """The links of a machine as one description, whichever keys its configuration is written with.

    A machine has n rods, m actuators and k = 6 - n hinges. `kinematics: tripod_3spr` and `hexapod_6ups` are short for
    actuators that extend one rod each; every other machine states `actuators`, `rods`, `hinges` and `target_fixes`.

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


_ROOT = "geometry"


class GeometryKeys(NamedTuple):
    """Where the numbers of a geometry stand in its file, in either form of a geometry.

    `described` reads both forms into one description; this is the way back.

    The places of a geometry's numbers; links, hinges and actuators count from 0.

    by_rods : whether it is stated by `actuators` and `rods`.  hinge_names : the key of the axis of each hinge.
    tool_on_platform : whether the platform carries the tool.
    """

    by_rods: bool
    hinge_names: tuple[str, ...]
    tool_on_platform: bool

    def base_joint(self, link: int) -> Location:
        """A vector in {B}, mm."""
        return (_ROOT, "rods", link, "base_B_mm") if self.by_rods else (_ROOT, "base", "joints_B_mm", link)

    def platform_joint(self, link: int) -> Location:
        """A vector in {P}, mm."""
        return (_ROOT, "rods", link, "platform_P_mm") if self.by_rods else (_ROOT, "platform", "joints_P_mm", link)

    def hinge_axis(self, hinge: int) -> Location:
        """A unit vector, in {P} or, where the base carries the hinge, in {B}."""
        if not self.by_rods:
            return (_ROOT, "platform", "revolute_axes_P", hinge)
        return (_ROOT, "hinges", hinge, self.hinge_names[hinge])

    def rod_length(self, link: int) -> Location:
        """Of a rod that no actuator extends, mm."""
        return (_ROOT, "rods", link, "length_mm")

    def actuator(self, actuator: int, name: str) -> Location:
        """A number of an actuator: `along_B`, `cosine_B`, `sine_B`, `radius_mm`."""
        return (_ROOT, "actuators", actuator, name)

    @property
    def tool(self) -> Location:
        """The tip: a vector in {P}, of a tool on the plate in {M}; mm."""
        return (_ROOT, "tool", "at_P_mm" if self.tool_on_platform else "at_M_mm")

    @property
    def zero_contact(self) -> Location:
        """The place of the tip at machine zero: a vector in {M}, of a tool on the plate in {P}; mm."""
        return (_ROOT, "tool", "zero_tip_M_mm" if self.tool_on_platform else "zero_tip_P_mm")

    @property
    def zero_attitude(self) -> Location:
        """The attitude of {P} at machine zero: a rotation vector in {M}, rad."""
        return (_ROOT, "tool", "zero_rotation_P_in_M_rad")


LINKS: Mapping[str, int] = {"tripod_3spr": 3, "hexapod_6ups": 6}


class BasePlatform(Section):
    """The base platform: its three supports and the base joints they carry."""

    origin_B0_in_M_mm: Vector = Field(default=(0.0, 0.0, 0.0), description="origin of {B} at machine zero, in {M}")
    rotation_B0_in_M_rad: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description="rotation vector of {B} at machine zero in {M}; any pose: above, under or beside the work",
    )
    supports_B_mm: tuple[Vector, Vector, Vector] | None = Field(
        default=None,
        description="frame reference points b1, b2, b3 in {B}: centroid 0, z 0, b1 on +y; "
        "left out: the frame has no comparators",
    )
    joints_B_mm: tuple[Vector, ...] = Field(
        default=(), description="with `kinematics`: base joint centres at machine zero, in {B}, link by link"
    )
    support_of_joint: tuple[Annotated[int, Field(ge=1, le=3)], ...] = Field(
        default=(),
        description="for each base joint the support (1, 2 or 3) that carries it; needed with `supports_B_mm`",
    )


class MovingPlatform(Section):
    """The moving platform: its joints, and the revolute axes of a tripod."""

    joints_P_mm: tuple[Vector, ...] = Field(
        default=(), description="with `kinematics`: platform joint centres in {P}, link by link"
    )
    revolute_axes_P: tuple[Direction, ...] = Field(
        default=(), description="tripod only: unit vector along each revolute axis, in {P}"
    )
    weight_N: Annotated[float, Field(ge=0, allow_inf_nan=False)] = Field(description="weight of the moving platform")
    weight_at_P_mm: Vector = Field(default=(0.0, 0.0, 0.0), description="where the weight acts, in {P}")


# Of places and lengths, in mm. Ground parts, and a drawing of measured places: some micrometres. Milled and turned
# parts without stated tolerance: 0.05, ISO 2768-1 fine for small dimensions. Printed parts 0.2 to 1; joints placed by
# hand, with a tape measure, 5.
TOLERANCES_MM = {"ground": 0.005, "measured": 0.005, "machined": 0.05, "printed": 1.0, "hand-built": 5.0}


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

    kinematics: Literal["tripod_3spr", "hexapod_6ups"] | None = Field(
        default=None,
        description="three links with spherical base joints and revolute platform joints, or six with universal base "
        "joints and spherical platform joints; left out: the machine is stated by `actuators` and `rods`",
    )
    actuators: tuple[Actuator, ...] = Field(default=(), description="what moves the rods; any parallel machine")
    rods: tuple[Rod, ...] = Field(default=(), description="the links, 3 to 6")
    hinges: tuple[Hinge, ...] = Field(default=(), description="revolute joints, as many as 6 less the rods")
    target_fixes: tuple[Coordinate, ...] = Field(
        default=(),
        description="the coordinates that a target fixes, as many as actuators: x y z of the tip, turns a b c about x "
        "y z of {M}",
    )
    base: BasePlatform = Field(default=BasePlatform(), description="the base platform, which carries the base joints")
    platform: MovingPlatform = Field(description="the moving platform")
    tool: Annotated[ToolOnPlatformSettings | ToolOnPlateSettings, Field(discriminator="on")] = Field(
        description="the tool, on the moving platform or on the surface plate"
    )
    plate_points_M_mm: tuple[Vector, Vector, Vector] | None = Field(
        default=None, description="reference points m1, m2, m3, in {M}; left out: the frame has no comparators"
    )
    link_length_mm: tuple[Positive, Positive] | None = Field(
        default=None, description="shortest and longest length of a link, joint to joint; a target beyond is refused"
    )
    plate_thickness_mm: Positive | None = Field(default=None, description="thickness of the surface plate")
    scale_signal_period_mm: Positive | None = Field(default=None, description="signal period of the linear scales")

    tolerance_mm: Literal["ground", "measured", "machined", "printed", "hand-built"] | Positive | None = Field(
        default=None,
        description="how far places and lengths of the machine as built may be from those in this file: a number, or a "
        "class: ground, measured 0.005; machined 0.05; printed 1; hand-built 5. Plausible ranges of geometric effects "
        "follow from it; left out, they are the library's",
    )

    @property
    def made_to_mm(self) -> float | None:
        """The tolerance in mm; None where it is not stated."""
        return TOLERANCES_MM[self.tolerance_mm] if isinstance(self.tolerance_mm, str) else self.tolerance_mm

    @property
    def mechanism(self) -> MechanismDescription:
        """The links, whichever keys they are written with."""
        return described(self)

    @property
    def keys(self) -> GeometryKeys:
        """Where its numbers stand in the file."""
        hinge_names = tuple("axis_P" if hinge.axis_B is None else "axis_B" for hinge in self.hinges)
        return GeometryKeys(bool(self.rods), hinge_names, isinstance(self.tool, ToolOnPlatformSettings))

    @property
    def links(self) -> int:
        """Number of links (rods), 3 to 6, which knows the number of scales."""
        return LinkCount(LINKS[self.kinematics] if self.kinematics else len(self.rods), self.scales)

    @property
    def scales(self) -> int:
        """Number of actuators, each of which may have a scale."""
        return LINKS[self.kinematics] if self.kinematics else len(self.actuators)

    @property
    def has_frame(self) -> bool:
        """Whether the frame's reference points are stated, without which it is taken to stand still."""
        return self.plate_points_M_mm is not None
