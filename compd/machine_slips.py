"""Slips of the geometry that leave a machine which can be computed: points in another order than the links and rods.

The points of a machine stand near those that they belong to. Where another order of a list would make its links, or its
rods, clearly shorter, the list is probably in the wrong order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.configuration.document import Document, Location
from compd.configuration.geometry import Geometry
from compd.errors import Problem
from compd.model.machine import MachineModel

# Squared lengths that are smaller by a hundredth: points as drawn are the nearest to their own, exactly.
_CLEARLY = 0.99
# From the attitude of the drawing, rad: joints and axes of one machine agree far better.
_TURNED_RAD = 0.1
# Supports and plate points at the ends of u1 to u6, from 0 (paper, figure 7).
_RODS = ((0, 0), (0, 2), (1, 0), (1, 1), (2, 1), (2, 2))


def slips(document: Document, geometry: Geometry, model: MachineModel) -> Iterator[Problem]:
    """A warning for each."""
    yield from _crossed_links(document, model)
    yield from _crossed_rods(document, geometry)
    yield from _far_joints(document, geometry)
    drawn = Rotation.from_rotvec(geometry.tool.zero_rotation_P_in_M_rad)
    turned_rad = (drawn.inv() * Rotation.from_matrix(model.zero.rotation_M_P)).magnitude()
    if turned_rad > _TURNED_RAD:
        yield Problem(
            where=document.where(("geometry", "platform")),
            what="is not plausible: at machine zero it is turned against zero_rotation_P_in_M_rad",
            value=f"{turned_rad:.3g} rad",
            next_step="look whether joints_P_mm, revolute_axes_P and joints_B_mm are in the same order",
        )


def _crossed_links(document: Document, model: MachineModel) -> Iterator[Problem]:
    base_mm = model.zero.base_joints_M_mm
    platform_mm = model.zero.platform_origin_M_mm + model.platform_joints_P_mm @ model.zero.rotation_M_P.T
    squares = _squares(base_mm, platform_mm)
    rows, order = linear_sum_assignment(squares)
    if squares[rows, order].sum() < _CLEARLY * np.trace(squares):
        location = ("geometry", "platform", "joints_P_mm")
        yield _in_another_order(document, location, "the links cross one another", order.tolist())


def _crossed_rods(document: Document, geometry: Geometry) -> Iterator[Problem]:
    turned = Rotation.from_rotvec(geometry.base.rotation_B0_in_M_rad)
    supports_mm = geometry.base.origin_B0_in_M_mm + turned.apply(geometry.base.supports_B_mm)
    squares = _squares(supports_mm, np.array(geometry.plate_points_M_mm))
    sums = {order: sum(squares[b, order[m]] for b, m in _RODS) for order in permutations(range(3))}
    order = min(sums, key=sums.__getitem__)
    if sums[order] < _CLEARLY * sums[0, 1, 2]:
        location = ("geometry", "plate_points_M_mm")
        yield _in_another_order(document, location, "the rods u1 to u6 cross one another", order)


def _far_joints(document: Document, geometry: Geometry) -> Iterator[Problem]:
    squares = _squares(np.array(geometry.base.joints_B_mm), np.array(geometry.base.supports_B_mm))
    for joint, support in enumerate(geometry.base.support_of_joint):
        nearest = int(squares[joint].argmin())
        if squares[joint, nearest] < _CLEARLY * squares[joint, support - 1]:
            yield Problem(
                where=document.where(("geometry", "base", "support_of_joint", joint)),
                what=f"is not plausible: base joint {joint + 1} is nearer to support {nearest + 1}",
                value=str(support),
                next_step=f"write {nearest + 1}, or look whether joints_B_mm and supports_B_mm are in order",
            )


def _in_another_order(document: Document, location: Location, what: str, order: Sequence[int]) -> Problem:
    return Problem(
        where=document.where(location),
        what=f"is not plausible: {what}",
        next_step=f"in the order {', '.join(str(k + 1) for k in order)} they would not: look into the drawing",
    )


def _squares(one_mm: FloatArray, other_mm: FloatArray) -> FloatArray:
    """(n, m) squared distances between (n, 3) and (m, 3) points, mm2."""
    squares: FloatArray = ((one_mm[:, None] - other_mm[None]) ** 2).sum(axis=2)
    return squares
