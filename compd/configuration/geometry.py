"""The machine's geometry in the configuration: mm, radians, and the frame in every key."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator, Field

from compd.documents import Finite, Location, Positive, Section

LINKS: Mapping[str, int] = {"tripod_3spr": 3, "hexapod_6ups": 6}

# Largest deviation (mm) of a frame from its convention: a drawing gives coordinates to 1 nm at best.
CONVENTION_TOLERANCE_MM = 1e-6


Vector = tuple[Finite, Finite, Finite]


def _unit_vector(vector: Vector) -> Vector:
    """The vector itself; ValueError unless its length is 1."""
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
        return LINKS[self.kinematics]


class GeometryProblem(NamedTuple):
    """A contradiction in a geometry. location : below `geometry`."""

    location: Location
    what: str
    value: str = ""
    allowed: str = ""
    next_step: str = ""


def contradictions(geometry: Any) -> list[GeometryProblem]:
    """All contradictions in the readable parts of a geometry.

    geometry : a `Geometry`, or what `section.readable` makes of a faulty one.
    """
    base = getattr(geometry, "base", None)
    return [
        *_frame_contradictions(base),
        *_point_contradictions(geometry),
        *_count_contradictions(geometry),
        *_length_contradictions(geometry),
    ]


def _frame_contradictions(base: Any) -> Iterator[GeometryProblem]:
    """{B} is the frame of its supports: origin at their centroid, z_B their normal, y_B towards b1."""
    supports = getattr(base, "supports_B_mm", None)
    if supports is None:
        return
    b1, b2, b3 = supports
    place: Location = ("base", "supports_B_mm")
    for axis, name in enumerate("xyz"):
        mean = (b1[axis] + b2[axis] + b3[axis]) / 3
        if abs(mean) > CONVENTION_TOLERANCE_MM and name != "z":
            what = f"the centroid must be the origin of {{B}}, its {name} is {mean:.6g} mm"
            yield GeometryProblem(place, what, next_step=f"subtract {mean:.12g} from every {name}")
    for k, support in enumerate(supports):
        if abs(support[2]) > CONVENTION_TOLERANCE_MM:
            yield GeometryProblem((*place, k), "must lie in the plane z = 0 of {B}", f"z {support[2]:g} mm", "0")
    if abs(b1[0]) > CONVENTION_TOLERANCE_MM or b1[1] <= 0:
        yield GeometryProblem((*place, 0), "b1 must lie on +y", str(list(b1)), "[0, y, 0] with y > 0")
    if (b2[0] - b1[0]) * (b3[1] - b1[1]) - (b2[1] - b1[1]) * (b3[0] - b1[0]) <= 0:
        yield GeometryProblem(place, "(b2-b1) x (b3-b1) must point along +z", next_step="exchange b2 and b3")


def _point_contradictions(geometry: Any) -> Iterator[GeometryProblem]:
    """Coinciding points, and a plate with collinear points."""
    lists: tuple[tuple[Location, Any], ...] = (
        (("base", "joints_B_mm"), getattr(getattr(geometry, "base", None), "joints_B_mm", None)),
        (("platform", "joints_P_mm"), getattr(getattr(geometry, "platform", None), "joints_P_mm", None)),
        (("plate_points_M_mm",), getattr(geometry, "plate_points_M_mm", None)),
    )
    for location, points in lists:
        known = [(i, point) for i, point in enumerate(points or ()) if point is not None]
        for (i, one), (k, other) in combinations(known, 2):
            if math.dist(one, other) < CONVENTION_TOLERANCE_MM:
                yield GeometryProblem((*location, k), f"is the same point as entry {i + 1}", str(list(other)))
    plate = lists[-1][1]
    if plate is not None:
        sides_mm = sorted(math.dist(one, other) for one, other in combinations(plate, 2))
        if sides_mm[2] > 0 and sides_mm[0] + sides_mm[1] - sides_mm[2] < CONVENTION_TOLERANCE_MM and sides_mm[0] > 0:
            yield GeometryProblem(lists[-1][0], "the three points lie on one line", next_step="let them span the plate")


def _count_contradictions(geometry: Any) -> Iterator[GeometryProblem]:
    """Check that joints and axes match the links, and that a tripod has only keys of a tripod."""
    kinematics = getattr(geometry, "kinematics", None)
    if kinematics is None:
        return
    n = LINKS[kinematics]
    needed = {
        ("base", "joints_B_mm"): n,
        ("base", "support_of_joint"): n,
        ("platform", "joints_P_mm"): n,
        ("platform", "revolute_axes_P"): n if n == 3 else 0,
    }
    for (part, key), count in needed.items():
        entries = getattr(getattr(geometry, part, None), key, None)
        if entries is not None and len(entries) != count:
            what = f"has {len(entries)} entries, {kinematics} needs {count}"
            yield GeometryProblem((part, key), what, next_step="write one for each link" if count else "leave it out")
    rotation = getattr(getattr(geometry, "tool", None), "zero_rotation_P_in_M_rad", None)
    if n == 3 and rotation is not None and any(rotation):
        what = "a tripod's attitude follows from its tip"
        yield GeometryProblem(("tool", "zero_rotation_P_in_M_rad"), what, str(list(rotation)), next_step="leave it out")


def _length_contradictions(geometry: Any) -> Iterator[GeometryProblem]:
    limits = getattr(geometry, "link_length_mm", None)
    if limits is not None and limits[0] >= limits[1]:
        yield GeometryProblem(
            ("link_length_mm",), "must be the shortest length first, then the longest", str(list(limits))
        )
