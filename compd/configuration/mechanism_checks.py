"""Contradictions between the actuators, rods and hinges of a geometry, and what its target fixes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

from compd.configuration.geometry_problem import GeometryProblem

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
