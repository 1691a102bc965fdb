"""Targets for the controller: G-code of RS-274/NGC, as LinuxCNC reads it.

Of the language only G1, G4, G21, G90, G94, M0 and M2 are used, which every dialect has. X Y Z are the tool's tip in
{M}. A B C, where a plan turns the platform, are degrees about x, then y, then z of {M}, since machine zero: roll, pitch
and yaw of LinuxCNC's hexapod kinematics (genhexkins).
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.instruments.writers.target import TargetPoint

# Mark of a programme by compd, which may be overwritten.
MARK = "(compd plan"
# LinuxCNC reads lines of 255 characters; a person reads 100.
_COMMENT_WIDTH = 90


@dataclass(frozen=True)
class FeedAndDwell:
    """What a plan does not say. feed_mm_per_min : between places. dwell_s : at rest at each of them."""

    feed_mm_per_min: float
    dwell_s: float


def write_gcode(targets: Sequence[TargetPoint], motion: FeedAndDwell, title: str) -> bytes:
    """The programme. Every target needs a place.

    Where something is to be set that differs from the target before, the programme stops (M0) and says what.
    """
    return ("\n".join(_Programme(motion).lines(targets, title)) + "\n").encode("ascii")


class _Programme:
    """Writes lines, and knows where the tip is and what was set last."""

    def __init__(self, motion: FeedAndDwell) -> None:
        self._motion = motion
        self._here_M_mm: FloatArray | None = None
        self._set: Mapping[str, float] | None = None
        # since the beginning of a programme, as far as feeds and dwells tell
        self._time_s = 0.0

    def lines(self, targets: Sequence[TargetPoint], title: str) -> Iterator[str]:
        yield f"{MARK}: {_clean(title)})"
        yield "(X Y Z: tip of the tool in the machine's frame M, mm. Try it without the machine first.)"
        if any(target.turn_rad is not None for target in targets):
            yield "(A B C: degrees about x, then y, then z of M, since machine zero.)"
        yield "G21 G90 G94"
        for target in targets:
            yield from self._target(target)
        yield "M2"

    def _target(self, target: TargetPoint) -> Iterator[str]:
        assert target.tip_M_mm is not None
        yield ""
        yield from _comments(f"{target.name}: {target.purpose}")
        if target.settings and dict(target.settings) != self._set:
            text = ", ".join(f"{name} {value:.10g}" for name, value in target.settings.items())
            yield from _comments(f"MSG, {target.name}: set {text}, then go on", "MSG, ")
            yield "M0"
        self._set = dict(target.settings)
        if target.begins:
            self._time_s = 0.0
        elif (wait_s := target.time_s - self._time_s - self._travel_s(target)) > 0:
            yield f"(at {target.time_s:.10g} s from the beginning of the programme)"
            yield self._pause(wait_s)
        way = target.way
        if target.no_way:
            yield from _comments(target.no_way)
        if way is not None:
            yield self._move(way.via_M_mm, self._motion.feed_mm_per_min, target.turn_rad)
        if way is not None and way.end_M_mm is not None:
            yield "(passes the place in the middle of this move, without a stop)"
            yield self._move(way.end_M_mm, 60.0 * way.speed_mm_per_s, target.turn_rad)
            return
        yield self._move(target.tip_M_mm, self._motion.feed_mm_per_min, target.turn_rad)
        yield self._pause(self._motion.dwell_s)

    def _move(self, to_M_mm: FloatArray, feed_mm_per_min: float, turn_rad: FloatArray | None) -> str:
        if self._here_M_mm is not None:
            self._time_s += 60.0 * float(np.linalg.norm(to_M_mm - self._here_M_mm)) / feed_mm_per_min
        self._here_M_mm = to_M_mm
        x, y, z = (_number(value) for value in to_M_mm.tolist())
        turn = ""
        if turn_rad is not None:
            degrees = Rotation.from_rotvec(turn_rad).as_euler("xyz", degrees=True).tolist()
            turn = "".join(f" {axis}{_number(value, 4)}" for axis, value in zip("ABC", degrees, strict=True))
        return f"G1 X{x} Y{y} Z{z}{turn} F{_number(feed_mm_per_min, 1)}"

    def _pause(self, seconds: float) -> str:
        self._time_s += seconds
        return f"G4 P{_number(seconds, 1)}"

    def _travel_s(self, target: TargetPoint) -> float:
        """Time of the way to the target, at the feed."""
        assert target.tip_M_mm is not None
        stations = [target.way.via_M_mm] if target.way is not None else []
        here, length_mm = self._here_M_mm, 0.0
        for station in (*stations, target.tip_M_mm):
            if here is not None:
                length_mm += float(np.linalg.norm(station - here))
            here = station
        return 60.0 * length_mm / self._motion.feed_mm_per_min


def _number(value: float, decimals: int = 3) -> str:
    """A number without an exponent, and without a minus before zero."""
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if math.isclose(float(text), 0.0, abs_tol=0.5 * 10.0**-decimals) else text


def _clean(text: str) -> str:
    """Text that may stand in a comment: ASCII, without parentheses."""
    tidy = text.replace("(", "[").replace(")", "]").replace("\u00b5", "u")
    return " ".join("".join(sign if sign.isascii() and sign.isprintable() else "?" for sign in tidy).split())


def _comments(text: str, again: str = "") -> Iterator[str]:
    """Comments, as many as the text needs. again : what each further one begins with."""
    for number, part in enumerate(textwrap.wrap(_clean(text), _COMMENT_WIDTH)):
        yield f"({again if number else ''}{part})"
