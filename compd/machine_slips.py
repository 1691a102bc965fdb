"""Slips of the geometry that leave a machine which can be computed: points in another order than the links and rods.

The points of a machine stand near those that they belong to. Where another order of a list would make its links, or its
rods, clearly shorter, the list is probably in the wrong order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Geometry, ToolOnPlatformSettings
from compd.documents import Document, Location
from compd.errors import Problem
from compd.model import MachineModel
from compd.rotation import rotation_matrix, rotation_vector

# Squared lengths that are smaller by a hundredth: points as drawn are the nearest to their own, exactly.
_CLEARLY = 0.99
# From the attitude of the drawing, rad: joints and axes of one machine agree far better.
_TURNED_RAD = 0.1
# Supports and plate points at the ends of u1 to u6, from 0 (paper, figure 7).
_RODS = ((0, 0), (0, 2), (1, 0), (1, 1), (2, 1), (2, 2))


# Base joints lie beside their supports: no further than this part of the way from one support to the next, beyond what
# the others do.
_FAR = 0.1
# A revolute axis is across its link: at most this is their scalar product, as unit vectors.
_ALONG = 0.3
# Half of the right angle to which a platform might be tilted at machine zero, rad: far more than any link allows.
_TILTED_RAD = 0.8


def slips(document: Document, geometry: Geometry, model: MachineModel) -> Iterator[Problem]:
    """A warning for each."""
    yield from _crossed_links(document, model)
    if geometry.has_frame:
        yield from _crossed_rods(document, geometry)
        yield from _far_joints(document, geometry)
        yield from _base_beside_plate(document, geometry)
    yield from axes_along_links(document, geometry)
    upright = rotation_matrix(geometry.base.rotation_B0_in_M_rad).T @ model.zero.rotation_M_P
    tilted_rad = float(np.arccos(min(abs(upright[2, 2]), 1.0)))
    if tilted_rad > _TILTED_RAD:
        yield Problem(
            document.where(("geometry", "tool", "zero_rotation_P_in_M_rad")),
            "is not plausible: at machine zero the platform is tilted against the base",
            value=f"{tilted_rad:.3g} rad",
            next_step="in degrees? Rotation vectors are in rad",
        )
    drawn = rotation_matrix(geometry.tool.zero_rotation_P_in_M_rad)
    turned_rad = float(np.linalg.norm(rotation_vector(drawn.T @ model.zero.rotation_M_P)))
    if turned_rad > _TURNED_RAD:
        yield Problem(
            document.where(("geometry", "platform")),
            "is not plausible: at machine zero it is turned against zero_rotation_P_in_M_rad",
            value=f"{turned_rad:.3g} rad",
            next_step="look whether joints_P_mm, revolute_axes_P and joints_B_mm are in the same order",
        )


def _crossed_links(document: Document, model: MachineModel) -> Iterator[Problem]:
    base_mm = model.zero.base_joints_M_mm
    platform_mm = model.zero.platform_origin_M_mm + model.platform_joints_P_mm @ model.zero.rotation_M_P.T
    squares = _squares(base_mm, platform_mm)
    links = range(len(squares))
    order = min(permutations(links), key=lambda order: sum(squares[k, order[k]] for k in links))
    if squares[links, order].sum() < _CLEARLY * np.trace(squares):
        location = ("geometry", "platform", "joints_P_mm")
        yield _in_another_order(document, location, "the links cross one another", order)


def _crossed_rods(document: Document, geometry: Geometry) -> Iterator[Problem]:
    turned = rotation_matrix(geometry.base.rotation_B0_in_M_rad)
    supports_mm = geometry.base.origin_B0_in_M_mm + np.array(geometry.base.supports_B_mm) @ turned.T
    squares = _squares(supports_mm, np.array(geometry.plate_points_M_mm))
    sums = {order: sum(squares[b, order[m]] for b, m in _RODS) for order in permutations(range(3))}
    order = min(sums, key=sums.__getitem__)
    if sums[order] < _CLEARLY * sums[0, 1, 2]:
        location = ("geometry", "plate_points_M_mm")
        yield _in_another_order(document, location, "the rods u1 to u6 cross one another", order)


def _far_joints(document: Document, geometry: Geometry) -> Iterator[Problem]:
    supports_mm = np.array(geometry.base.supports_B_mm)
    squares = _squares(np.array([rod.base_B_mm for rod in geometry.mechanism.rods]), supports_mm)
    own_mm = np.sqrt([squares[joint, support - 1] for joint, support in enumerate(geometry.base.support_of_joint)])
    allowed_mm = float(
        np.median(own_mm) + _FAR * np.sqrt(_squares(supports_mm, supports_mm)[np.triu_indices(3, 1)].min())
    )
    for joint, support in enumerate(geometry.base.support_of_joint):
        nearest = int(squares[joint].argmin())
        if squares[joint, nearest] < _CLEARLY * squares[joint, support - 1]:
            yield Problem(
                document.where(("geometry", "base", "support_of_joint", joint)),
                f"is not plausible: base joint {joint + 1} is nearer to support {nearest + 1}",
                value=str(support),
                next_step=f"write {nearest + 1}, or look whether joints_B_mm and supports_B_mm are in order",
            )
        elif own_mm[joint] > allowed_mm:
            yield Problem(
                document.where(("geometry", "base", "joints_B_mm", joint)),
                f"is not plausible: base joint {joint + 1} is far from its support {support}",
                value=f"{own_mm[joint]:.1f} mm",
                allowed=f"{allowed_mm:.1f} mm, after the other joints",
                next_step="look into the drawing, or ignore this where the machine is so",
            )


def _base_beside_plate(document: Document, geometry: Geometry) -> Iterator[Problem]:
    """The base's centre is above the triangle of the plate points, or the rods lean all to one side."""
    corners_mm = np.array(geometry.plate_points_M_mm)
    base_mm = np.array(geometry.base.origin_B0_in_M_mm)
    normal = np.cross(corners_mm[1] - corners_mm[0], corners_mm[2] - corners_mm[0])
    inside = [np.cross(corners_mm[(k + 1) % 3] - corners_mm[k], base_mm - corners_mm[k]) @ normal > 0 for k in range(3)]
    if not all(inside):
        yield Problem(
            document.where(("geometry", "plate_points_M_mm")),
            "is not plausible: the base platform is not above the triangle of these points",
            next_step="look at the signs of the points and of base.origin_B0_in_M_mm",
        )


def axes_along_links(document: Document, geometry: Geometry) -> Iterator[Problem]:
    """A warning for each revolute axis that is not across its link, with the platform upright at machine zero."""
    tool, base, platform = geometry.tool, geometry.base, geometry.platform
    if not platform.revolute_axes_P or not isinstance(tool, ToolOnPlatformSettings):
        return
    turned = rotation_matrix(base.rotation_B0_in_M_rad)
    base_mm = base.origin_B0_in_M_mm + np.array(base.joints_B_mm) @ turned.T
    upright = rotation_matrix(tool.zero_rotation_P_in_M_rad)
    joints_mm = tool.zero_tip_M_mm + (np.array(platform.joints_P_mm) - tool.at_P_mm) @ upright.T
    for k, axis in enumerate(platform.revolute_axes_P):
        link = (base_mm[k] - joints_mm[k]) / np.linalg.norm(base_mm[k] - joints_mm[k])
        along = abs(float(upright @ axis @ link))
        if along > _ALONG:
            yield Problem(
                document.where(("geometry", "platform", "revolute_axes_P", k)),
                f"is not plausible: the axis is not across link {k + 1}, which turns about it",
                value=f"{np.degrees(np.arccos(min(along, 1.0))):.0f} deg between them",
                allowed="90 deg at an upright platform",
                next_step="axes are tangential: (-sin, cos, 0) of the joint's angle",
            )


def _in_another_order(document: Document, location: Location, what: str, order: Sequence[int]) -> Problem:
    return Problem(
        document.where(location),
        f"is not plausible: {what}",
        next_step=f"in the order {', '.join(str(k + 1) for k in order)} they would not: look into the drawing",
    )


def _squares(one_mm: FloatArray, other_mm: FloatArray) -> FloatArray:
    """(n, m) squared distances between (n, 3) and (m, 3) points, mm2."""
    squares: FloatArray = ((one_mm[:, None] - other_mm[None]) ** 2).sum(axis=2)
    return squares
