"""The limits of a correction: its size and its slew, per link. What they change, they say."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.configuration.operation import LimitSettings
from compd.live.loop.setpoint import State

# A step that exceeds the slew limit by rounding alone is no slewing.
_ROUNDING_MM = 1e-12


class Limited(NamedTuple):
    """What may be applied.

    applied_mm : (n) correction within its limits; the previous one where `state` is REFUSED.
    state : OK, SLEWING, CLAMPED or REFUSED.
    reason : which link, what it wanted, what it got; "" when OK.
    """

    applied_mm: FloatArray
    state: State
    reason: str


def limited(wanted_mm: FloatArray, previous_mm: FloatArray, period_s: float, limits: LimitSettings) -> Limited:
    """The correction (n) that may follow `previous_mm` (n), one period later.

    The period is the loop's own, not the time that passed: after missed cycles a correction takes
    longer, it does not take a larger step.
    """
    wanted = wanted_mm.tolist()
    previous = previous_mm.tolist()
    largest, step = limits.correction_mm, limits.slew_mm_per_s * period_s
    if not all(map(math.isfinite, wanted)):
        return Limited(previous_mm, State.REFUSED, f"{_first_not_finite(wanted)}, refused; the last one is kept")
    beyond = [link for link, value in enumerate(wanted) if abs(value) > largest]
    if beyond and limits.on_limit == "refuse":
        return Limited(previous_mm, State.REFUSED, _beyond(beyond, wanted, largest, "refused"))
    allowed = [min(max(value, -largest), largest) for value in wanted]
    late = [i for i, value in enumerate(allowed) if abs(value - previous[i]) > step + _ROUNDING_MM]
    for i in late:
        allowed[i] = previous[i] + math.copysign(step, allowed[i] - previous[i])
    if beyond:
        return Limited(np.array(allowed), State.CLAMPED, _beyond(beyond, wanted, largest, "clamped"))
    if late:
        return Limited(np.array(allowed), State.SLEWING, _slewing(late[0], wanted, allowed, limits.slew_mm_per_s))
    return Limited(wanted_mm, State.OK, "")


def beyond_stroke(length_mm: FloatArray, stroke_mm: tuple[float, float] | None) -> str:
    """Which links (n) would be shorter or longer than they can be, in words; "" when none, or no stroke is known."""
    if stroke_mm is None:
        return ""
    shortest, longest = stroke_mm
    return "; ".join(
        f"link {i + 1}: {length:.3f} mm is beyond its stroke, {shortest:g} to {longest:g} mm"
        for i, length in enumerate(length_mm.tolist())
        if not shortest <= length <= longest
    )


def _beyond(links: list[int], wanted: list[float], largest: float, done: str) -> str:
    return "; ".join(
        f"link {i + 1}: correction {wanted[i]:.3f} mm beyond {math.copysign(largest, wanted[i]):.3f} mm, {done}"
        for i in links
    )


def _slewing(i: int, wanted: list[float], allowed: list[float], slew_mm_per_s: float) -> str:
    return f"link {i + 1}: correction {wanted[i]:.4f} mm wanted, {allowed[i]:.4f} mm reached at {slew_mm_per_s:g} mm/s"


def _first_not_finite(wanted: list[float]) -> str:
    i = next(i for i, value in enumerate(wanted) if not math.isfinite(value))
    return f"link {i + 1}: correction {wanted[i]} is not finite"
