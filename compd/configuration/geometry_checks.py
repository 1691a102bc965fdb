"""Contradictions in the geometry of a configuration."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations
from typing import Any

from compd.configuration.geometry import LINKS, Geometry
from compd.configuration.geometry_problem import GeometryProblem
from compd.configuration.mechanism_checks import mechanism_contradictions
from compd.documents import Location

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
