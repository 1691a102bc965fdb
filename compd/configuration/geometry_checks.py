"""Contradictions in the geometry of a configuration."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

from compd.configuration.geometry import LINKS, Geometry
from compd.configuration.geometry_problem import GeometryProblem
from compd.documents import Location

# Largest scalar product of two unit vectors that are square to each other in a drawing.
SQUARE_TOLERANCE = 1e-6


def mechanism_contradictions(geometry: Any) -> Iterator[GeometryProblem]:
    """All contradictions in the readable parts of a geometry's links; those with a fault of their own are None."""
    if getattr(geometry, "kinematics", None) is not None:
        yield from _stated_twice(geometry)
        return
    parts: list[Any] = [getattr(geometry, name, None) for name in ("actuators", "rods", "hinges", "target_fixes")]
    if any(part is None for part in parts):
        return
    actuators, rods, hinges, fixes = parts
    if not rods:
        next_step = "write `kinematics`, or `actuators`, `rods`, `hinges` and `target_fixes`"
        yield GeometryProblem((), "does not state how the links are built", next_step=next_step)
        return
    for part, key in (("base", "joints_B_mm"), ("platform", "joints_P_mm"), ("platform", "revolute_axes_P")):
        if getattr(getattr(geometry, part, None), key, None):
            yield GeometryProblem((part, key), "belongs to `kinematics`", next_step="state the joints under `rods`")
    open_freedoms = 6 - len(rods) - len(hinges)
    if not 3 <= len(rods) <= 6 or open_freedoms:
        what = f"{len(rods)} rods and {len(hinges)} hinges leave {open_freedoms} degrees of freedom"
        yield GeometryProblem(("rods",), what, allowed="3 to 6 rods, and hinges up to six together")
    if len(fixes) != len(actuators) or len(set(fixes)) < len(fixes):
        what = f"names {len(set(fixes))} coordinates for {len(actuators)} actuators"
        yield GeometryProblem(("target_fixes",), what, allowed=f"{len(actuators)} different ones of x y z a b c")
    yield from _actuator_contradictions(actuators)
    yield from _rod_contradictions(rods, actuators)
    yield from _hinge_contradictions(hinges, len(rods))


def _stated_twice(geometry: Any) -> Iterator[GeometryProblem]:
    for name in ("actuators", "rods", "hinges", "target_fixes"):
        if getattr(geometry, name, None):
            what = f"states the machine a second time beside `kinematics: {geometry.kinematics}`"
            yield GeometryProblem((name,), what, next_step="leave out one of the two")


def _actuator_contradictions(actuators: Sequence[Any]) -> Iterator[GeometryProblem]:
    for k, actuator in enumerate(actuators):
        cosine, sine = getattr(actuator, "cosine_B", None), getattr(actuator, "sine_B", None)
        if cosine and sine and abs(sum(c * s for c, s in zip(cosine, sine, strict=True))) > SQUARE_TOLERANCE:
            yield GeometryProblem(("actuators", k), "cosine_B and sine_B must be square to each other")


def _rod_contradictions(rods: Sequence[Any], actuators: Sequence[Any]) -> Iterator[GeometryProblem]:
    for k, rod in enumerate(rods):
        number = getattr(rod, "actuator", None)
        if number is None:
            continue
        if number > len(actuators):
            yield GeometryProblem(("rods", k, "actuator"), "is not there", str(number), f"1 to {len(actuators)}")
            continue
        kind = getattr(actuators[number - 1], "kind", None)
        if kind in ("slides", "turns") and rod.length_mm == 0:
            yield GeometryProblem(("rods", k), "has no length", next_step="write `length_mm`")
    whole = [k for k, rod in enumerate(rods) if rod is not None and None not in (rod.base_B_mm, rod.platform_P_mm)]
    for i, k in combinations(whole, 2):
        if rods[i].base_B_mm == rods[k].base_B_mm and rods[i].platform_P_mm == rods[k].platform_P_mm:
            yield GeometryProblem(("rods", k), f"repeats rod {i + 1}", next_step="give each rod joints of its own")
    numbers = {getattr(rod, "actuator", None) for rod in rods}
    if None not in numbers:
        for number in sorted(set(range(1, len(actuators) + 1)) - numbers):
            location = ("actuators", number - 1)
            yield GeometryProblem(location, "moves no rod", next_step="name it in a rod, or leave it out")


def _hinge_contradictions(hinges: Sequence[Any], rods: int) -> Iterator[GeometryProblem]:
    for k, hinge in enumerate(hinges):
        if hinge is None:
            continue
        if (hinge.axis_P is None) == (hinge.axis_B is None):
            what = "needs one axis: axis_P, fixed to the platform, or axis_B, fixed to the base"
            yield GeometryProblem(("hinges", k), what)
        if hinge.rod is not None and hinge.rod > rods:
            yield GeometryProblem(("hinges", k, "rod"), "is not there", str(hinge.rod), f"1 to {rods}")


# Largest deviation (mm) of a frame from its convention: a drawing gives coordinates to 1 nm at best.
CONVENTION_TOLERANCE_MM = 1e-6


def contradictions(geometry: Any) -> list[GeometryProblem]:
    """All contradictions in the readable parts of a geometry.

    geometry : a `Geometry`, or what `section.readable` makes of a faulty one.
    """
    base = getattr(geometry, "base", None)
    return [
        *_frame_contradictions(base),
        *_point_contradictions(geometry),
        *_count_contradictions(geometry),
        *mechanism_contradictions(geometry),
        *_half_frame(geometry),
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
        ("base", "support_of_joint"): 0 if getattr(geometry.base, "supports_B_mm", None) is None else n,
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


def _half_frame(geometry: Any) -> Iterator[GeometryProblem]:
    """Frame reference points on the base and on the plate are stated together, or neither."""
    base = getattr(geometry, "base", None)
    supports = getattr(base, "supports_B_mm", None)
    plate = getattr(geometry, "plate_points_M_mm", None)
    # an unreadable key has a problem of its own
    if base is None or not isinstance(geometry, Geometry):
        return
    if geometry.kinematics is None and supports is not None and len(base.support_of_joint) != geometry.links:
        what = f"has {len(base.support_of_joint)} entries for {geometry.links} rods"
        yield GeometryProblem(("base", "support_of_joint"), what, next_step="write one for each rod")
    if (supports is None) == (plate is None):
        return
    missing: Location = ("base", "supports_B_mm") if supports is None else ("plate_points_M_mm",)
    yield GeometryProblem(missing, "is missing: frame comparators stand between supports and plate points")


def _length_contradictions(geometry: Any) -> Iterator[GeometryProblem]:
    limits = getattr(geometry, "link_length_mm", None)
    if limits is not None and limits[0] >= limits[1]:
        yield GeometryProblem(
            ("link_length_mm",), "must be the shortest length first, then the longest", str(list(limits))
        )
