"""What a machine can do, from its kinematics: freedom, rows that say the same, workspace, and the nearest singularity.

The amplification is the root of the sum of squares of J^-1, the closure's inverse derivatives, with rotations of the
platform times its radius: how many micrometres of pose one of length makes. At `AMPLIFICATION_LIMIT` the machine counts
as singular, as in every cycle (C. Gosselin, J. Angeles, IEEE Trans. Robotics Automation 6 (1990) 281).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.model import MachineModel, MachineParts
from compd.model.kernels import AMPLIFICATION_LIMIT, Reason
from compd.model.kinematics import Mechanism, closure_at, inverse_kinematics, links_at
from compd.rotation import compose, rotation_matrix

COORDINATES = ("x", "y", "z", "a", "b", "c")
# Steps of a way from machine zero, and its length: as shares of the longest rod; turns up to a right angle.
_STEPS = 120
_LONGEST_SHARE = 2.0
_LARGEST_RAD = np.pi / 2
# Rows whose directions differ by less say the same: a thousandth is a micrometre in a millimetre.
_SAME = 1e-3
# Share of a dependence that a row must have to be named.
_NAMED_SHARE = 0.3


class CoordinateReach(NamedTuple):
    """How far a machine gets along one coordinate that a target fixes, and why no farther.

    coordinate : one of `COORDINATES`.  sign : 1 or -1.  reach : mm, or rad of a turn.  ends : "singularity", "reach",
    "stroke", or "" where the whole way was gone.
    """

    coordinate: str
    sign: int
    reach: float
    ends: str


class MachineReach(NamedTuple):
    """What a machine can do from machine zero.

    fixes : the coordinates that a target fixes; others follow.  amplification : at machine zero.  ways : two for each
    coordinate that a target fixes.
    """

    fixes: tuple[str, ...]
    amplification: float
    ways: tuple[CoordinateReach, ...]

    @property
    def nearest_singularity(self) -> CoordinateReach | None:
        """The shortest way along x, y or z that ends at one, else the smallest turn; None where none was met."""
        met = [way for way in self.ways if way.ends == "singularity"]
        return min(met, key=lambda way: (way.coordinate in "abc", way.reach), default=None)


def machine_reach(model: MachineModel, stroke_mm: tuple[float, float] | None = None) -> MachineReach:
    """From machine zero along each coordinate that a target fixes, both ways, in steps of a sixtieth of a rod.

    stroke_mm : shortest and longest length of an extending link, or None.
    """
    zero, fixed = model.zero, model.actuators.fixed == 1
    places = np.flatnonzero(np.repeat(fixed, 2)) // 2
    signs = np.tile([1, -1], len(places) // 2)
    tip_P_mm = np.broadcast_to(zero.contact.tip_P_mm, (len(places), 3))
    guess_mm = np.broadcast_to(zero.actuator_mm, (len(places), model.scales)).copy()
    attitude = np.broadcast_to(zero.rotation_M_P, (len(places), 3, 3)).copy()
    mechanism = Mechanism(model.base_joints_at_0_M_mm, model.platform_joints_P_mm, model.revolute_axes_P, model.hinges)
    longest = np.where(places < 3, _LONGEST_SHARE * float(zero.link_length_mm.max()), _LARGEST_RAD)
    reach, ends = np.zeros(len(places)), [""] * len(places)
    going = np.ones(len(places), dtype=bool)
    for step in range(1, _STEPS + 1):
        if not going.any():
            break
        change = np.zeros((len(places), 6))
        change[np.arange(len(places)), places] = signs * longest * step / _STEPS
        tips = zero.contact.tip_M_mm + change[:, :3]
        wanted = compose(rotation_matrix(change[:, 3:]), zero.rotation_M_P)
        wanted = np.where(fixed[3:].any(), wanted, attitude)
        found = inverse_kinematics(mechanism, model.actuators, tips, tip_P_mm, wanted, guess_mm)
        for way in np.flatnonzero(going):
            if found.pose.reason[way]:
                near = found.pose.reason[way] in (Reason.NEAR_SINGULAR, Reason.OTHER_ASSEMBLY)
                ends[way], going[way] = "singularity" if near else "reach", False
            elif not within_stroke(model, found.pose.link_length_mm[way], stroke_mm):
                ends[way], going[way] = "stroke", False
            else:
                reach[way] = longest[way] * step / _STEPS
                guess_mm[way], attitude[way] = found.actuator_mm[way], found.pose.rotation_M_P[way]
    ways = tuple(
        CoordinateReach(COORDINATES[place], int(sign), float(far), end)
        for place, sign, far, end in zip(places, signs, reach, ends, strict=True)
    )
    return MachineReach(
        tuple(name for name, one in zip(COORDINATES, fixed, strict=True) if one),
        amplification(model.mechanism(zero.base_joints_M_mm), zero.platform_origin_M_mm, zero.rotation_M_P),
        ways,
    )


def amplification(mechanism: Mechanism, origin_M_mm: FloatArray, rotation_M_P: FloatArray) -> float:
    """See the module's docstring; inf at a singularity."""
    return float(amplifications(mechanism, origin_M_mm, rotation_M_P))


def amplifications(mechanism: Mechanism, origin_M_mm: FloatArray, rotation_M_P: FloatArray) -> FloatArray:
    """(...) the amplification at poses (..., 3), (..., 3, 3); inf at a singularity and where a pose is not finite."""
    J = _scaled_rows(mechanism, origin_M_mm, rotation_M_P)
    known = np.asarray(np.isfinite(J).all(axis=(-2, -1)))
    sizes: FloatArray = np.linalg.svd(np.where(known[..., None, None], J, 0.0), compute_uv=False)
    with np.errstate(divide="ignore"):
        return np.asarray(np.sqrt((1.0 / sizes**2).sum(axis=-1)))


def dependent_rows(
    mechanism: Mechanism, origin_M_mm: FloatArray, rotation_M_P: FloatArray
) -> tuple[tuple[str, ...], ...]:
    """Rods and hinges that together say one thing twice at a pose, each dependence as their names, 1-based.

    From the left null space of the rows of unit length: sum_i w_i row_i = 0. Rods between the same joints, three rods
    in a plane through one point, or a hinge along its own rod are found alike.
    """
    rows = _scaled_rows(mechanism, origin_M_mm, rotation_M_P)
    rows = rows / np.maximum(np.sqrt((rows * rows).sum(axis=1, keepdims=True)), 1e-12)
    if not np.isfinite(rows).all():
        return ()
    weights, sizes, _ = np.linalg.svd(rows)
    names = [f"rod {i + 1}" for i in range(mechanism.base_joints_M_mm.shape[-2])]
    names += [f"hinge {i + 1}" for i in range(6 - len(names))]
    found = []
    for weight in weights.T[sizes < _SAME * sizes[0]]:
        share = np.abs(weight) / np.abs(weight).max()
        found.append(tuple(name for name, own in zip(names, share, strict=True) if own >= _NAMED_SHARE))
    return tuple(found)


def dependences_as_drawn(parts: MachineParts) -> tuple[tuple[str, ...], ...]:
    """Dependent rows of parts that make no machine, where they are drawn: the actuators about at machine zero."""
    base_M_mm = np.asarray(parts.base_joints_M_mm, dtype=np.float64)
    joints_M_mm, _ = links_at(parts.actuators, base_M_mm, np.asarray(parts.actuator_guess_mm, dtype=np.float64))
    rotation = parts.rotation_M_B if parts.zero_rotation_M_P is None else parts.zero_rotation_M_P
    rotation_M_P = np.asarray(rotation, dtype=np.float64)
    axes = np.asarray(parts.revolute_axes_P, dtype=np.float64).reshape(-1, 3)
    mechanism = Mechanism(joints_M_mm, np.asarray(parts.platform_joints_P_mm, dtype=np.float64), axes, parts.hinges)
    origin_M_mm = parts.zero_contact.tip_M_mm - rotation_M_P @ parts.zero_contact.tip_P_mm
    return dependent_rows(mechanism, origin_M_mm, rotation_M_P)


def _scaled_rows(mechanism: Mechanism, origin_M_mm: FloatArray, rotation_M_P: FloatArray) -> FloatArray:
    """(..., 6, 6) derivatives of the closure's rows by displacement, and by rotation times the platform's radius."""
    closure = closure_at(mechanism, origin_M_mm, rotation_M_P)
    joints = mechanism.platform_joints_P_mm
    radius_mm = np.sqrt(((joints - joints.mean(axis=0)) ** 2).sum(axis=1).mean())
    by_displacement = np.concatenate([closure.length_by_displacement, closure.offset_by_displacement], axis=-2)
    by_rotation = np.concatenate([closure.length_by_rotation_mm, closure.offset_by_rotation_mm], axis=-2)
    return np.concatenate([by_displacement, by_rotation / radius_mm], axis=-1)


def within_stroke(model: MachineModel, lengths_mm: FloatArray, stroke_mm: tuple[float, float] | None) -> BoolArray:
    """(...) whether links (..., n) that extend have lengths within these; all where the limits are None or nan."""
    shortest_mm, longest_mm = stroke_mm or (np.nan, np.nan)
    extended = lengths_mm[..., model.extended]
    return np.asarray(~((extended < shortest_mm) | (extended > longest_mm)).any(axis=-1))


def reach_lines(reach: MachineReach) -> list[str]:
    """Degrees of freedom, workspace and nearest singularity, as `compd check` prints them."""
    follow = [name for name in COORDINATES if name not in reach.fixes]
    freedom = f"Degrees of freedom: {len(reach.fixes)}, a target fixes {' '.join(reach.fixes)}"
    lines = [freedom + (f"; {' '.join(follow)} follow." if follow else ".")]
    parts = []
    for name in reach.fixes:
        up, down = (next(way for way in reach.ways if (way.coordinate, way.sign) == (name, sign)) for sign in (1, -1))
        parts.append(f"{name} {_amount(down)} to {_amount(up)}")
    stated = "" if any(way.ends == "stroke" for way in reach.ways) else "; no stroke ends a way"
    lines.append(f"From machine zero, along one coordinate at a time, it reaches {', '.join(parts)}{stated}.")
    nearest = reach.nearest_singularity
    where = "none is met before the ways end"
    if nearest is not None:
        where = f"at {nearest.coordinate} {_amount(nearest)}"
    lines.append(
        f"At machine zero 1 um of length is up to {reach.amplification:.1f} um of the platform; nearest singularity "
        f"(more than {AMPLIFICATION_LIMIT:g} um): {where}."
    )
    return lines


def _amount(way: CoordinateReach) -> str:
    beyond = "" if way.ends else " or more"
    if way.coordinate in "abc":
        return f"{np.rad2deg(way.sign * way.reach):+.0f} deg{beyond}"
    return f"{way.sign * way.reach:+.0f} mm{beyond}"
