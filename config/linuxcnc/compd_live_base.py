"""Base joints that follow the machine's frame: for genhexkins, whose displayed pose is then that of the moved base.

The correction of a setpoint holds the frame already. Where the kinematics get the moved base joints, what they make of
them is taken off the correction again, so that a link is commanded to the same length either way.

The standard library alone. Lengths in mm, in {M}; vectors are three numbers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

Vector = Sequence[float]

_SETP = re.compile(r"^setp genhexkins\.(base|platform)\.(\d+)\.([xyz]) +(\S+)", re.MULTILINE)


class Hexapod(NamedTuple):
    """Joints of the nominal machine: the base's in {M}, the platform's seen from the tool's tip."""

    base_mm: list[list[float]]
    platform_mm: list[list[float]]


def read_geometry(text: str) -> Hexapod:
    """The joints that a HAL file sets for genhexkins. Raises ValueError where a coordinate is missing."""
    places = {(body, int(joint), axis): float(value) for body, joint, axis, value in _SETP.findall(text)}
    try:
        return Hexapod(
            *([[places[body, joint, axis] for axis in "xyz"] for joint in range(6)] for body in ("base", "platform"))
        )
    except KeyError as error:
        body, joint, axis = error.args[0]
        raise ValueError(f"genhexkins.{body}.{joint}.{axis} is not set: give the HAL file that sets all 36") from None


def base_shifts_mm(hexapod: Hexapod, frame: Sequence[float]) -> list[list[float]]:
    """How far each base joint has moved with the base platform.

    frame : origin of {B} now (3), its displacement since machine zero (3), and its rotation vector since then, rad (3).
    A rotation of 1 mrad is taken for small: 0.15 um on a radius of 300 mm.
    """
    origin, moved, turned = frame[:3], frame[3:6], frame[6:9]
    shifts = []
    for joint in hexapod.base_mm:
        x, y, z = (place - (now - way) for place, now, way in zip(joint, origin, moved, strict=True))
        a, b, c = turned
        shifts.append([moved[0] + b * z - c * y, moved[1] + c * x - a * z, moved[2] + a * y - b * x])
    return shifts


def length_changes_mm(hexapod: Hexapod, pose: Sequence[float], shifts_mm: Sequence[Vector]) -> list[float]:
    """By how much genhexkins commands each link longer for base joints that are moved by `shifts_mm`.

    pose : X, Y, Z (mm) and A, B, C (degrees) of the controller: roll, pitch, yaw.
    """
    roll, pitch, yaw = (math.radians(angle) for angle in pose[3:6])
    (sa, ca), (sb, cb), (sc, cc) = ((math.sin(angle), math.cos(angle)) for angle in (roll, pitch, yaw))
    rows = (
        (cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa),
        (sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa),
        (-sb, cb * sa, cb * ca),
    )
    changes = []
    for base, platform, shift in zip(hexapod.base_mm, hexapod.platform_mm, shifts_mm, strict=True):
        end = [
            at + sum(r * p for r, p in zip(row, platform, strict=True)) for at, row in zip(pose[:3], rows, strict=True)
        ]
        moved = [place + way for place, way in zip(base, shift, strict=True)]
        changes.append(math.dist(end, moved) - math.dist(end, base))
    return changes
