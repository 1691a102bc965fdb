"""The limits of a correction: its size and its rate of change (slew), for each link."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.operation_settings import LimitSettings
from compd.setpoint_states import State

# A step may exceed the slew limit by this much, which is rounding, without being reported as slewing.
_ROUNDING_MM = 1e-12


class LimitedCorrection(NamedTuple):
    """The correction that may be applied.

    applied_mm : (n) correction within its limits; the previous one where `state` is REFUSED.
    state : OK, SLEWING, CLAMPED or REFUSED.
    reason : which link, what it wanted, what it got; "" when OK.
    """

    applied_mm: FloatArray
    state: State
    reason: str


def limit_correction(
    wanted_mm: FloatArray, previous_mm: FloatArray, period_s: float, limits: LimitSettings
) -> LimitedCorrection:
    """The correction (n) that may follow `previous_mm` (n), one period later.

    `period_s` is the nominal period of the loop, not the time that has passed: after missed cycles a correction takes
    longer, its steps do not grow.
    """
    wanted = wanted_mm.tolist()
    previous = previous_mm.tolist()
    largest, step = limits.correction_mm, limits.slew_mm_per_s * period_s
    if not all(map(math.isfinite, wanted)):
        return LimitedCorrection(
            previous_mm, State.REFUSED, f"{_first_not_finite(wanted)}, refused; the last one is kept"
        )
    beyond = [link for link, value in enumerate(wanted) if abs(value) > largest]
    if beyond and limits.on_limit == "refuse":
        return LimitedCorrection(previous_mm, State.REFUSED, _beyond(beyond, wanted, largest, "refused"))
    allowed = [min(max(value, -largest), largest) for value in wanted]
    late = [i for i, value in enumerate(allowed) if abs(value - previous[i]) > step + _ROUNDING_MM]
    for i in late:
        allowed[i] = previous[i] + math.copysign(step, allowed[i] - previous[i])
    if beyond:
        return LimitedCorrection(np.array(allowed), State.CLAMPED, _beyond(beyond, wanted, largest, "clamped"))
    if late:
        return LimitedCorrection(
            np.array(allowed), State.SLEWING, _slewing(late[0], wanted, allowed, limits.slew_mm_per_s)
        )
    return LimitedCorrection(wanted_mm, State.OK, "")


def slewed(wanted_mm: FloatArray, previous_mm: FloatArray, period_s: float, limits: LimitSettings) -> FloatArray:
    """The correction (n) that a tip may have one period after one of `previous_mm`; `wanted_mm` itself where it is
    reached."""
    step = limits.slew_mm_per_s * period_s
    pairs = list(zip(wanted_mm.tolist(), previous_mm.tolist(), strict=True))
    allowed = [min(max(wanted, previous - step), previous + step) for wanted, previous in pairs]
    if all(abs(value - wanted) <= _ROUNDING_MM for value, (wanted, _) in zip(allowed, pairs, strict=True)):
        return wanted_mm
    return np.array(allowed)


def stroke_problem(length_mm: FloatArray, stroke_mm: tuple[float, float] | None) -> str:
    """Text that names the links (n) outside the stroke (shortest, longest); "" where none is, or no stroke is known."""
    if stroke_mm is None:
        return ""
    shortest, longest = stroke_mm
    return "; ".join(
        f"link {i + 1}: {length:.3f} mm is beyond its stroke, {shortest:g} to {longest:g} mm"
        for i, length in enumerate(length_mm.tolist())
        if not shortest <= length <= longest
    )


def _beyond(links: list[int], wanted: list[float], largest: float, action: str) -> str:
    return "; ".join(
        f"link {i + 1}: correction {wanted[i]:.3f} mm beyond {math.copysign(largest, wanted[i]):.3f} mm, {action}"
        for i in links
    )


def _slewing(i: int, wanted: list[float], allowed: list[float], slew_mm_per_s: float) -> str:
    return f"link {i + 1}: correction {wanted[i]:.4f} mm wanted, {allowed[i]:.4f} mm reached at {slew_mm_per_s:g} mm/s"


def _first_not_finite(wanted: list[float]) -> str:
    i = next(i for i, value in enumerate(wanted) if not math.isfinite(value))
    return f"link {i + 1}: correction {wanted[i]} is not finite"
