"""The limits of a correction: its size and its rate of change (slew), for each link."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.operation_settings import LimitSettings
from compd.setpoint_states import State

_LINKS = tuple(f"link {link}" for link in range(1, 7))
# A correction or its step may exceed its limit by this much, which is rounding, without being reported.
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
    wanted_mm: FloatArray,
    previous_mm: FloatArray,
    period_s: float,
    limits: LimitSettings,
    names: Sequence[str] = _LINKS,
) -> LimitedCorrection:
    """The correction (n) that may follow `previous_mm` (n), one period later. names : of its numbers, for people.

    `period_s` is the nominal period of the loop, not the time that has passed: after missed cycles a correction takes
    longer, its steps do not grow.
    """
    wanted = wanted_mm.tolist()
    previous = previous_mm.tolist()
    largest, step = limits.correction_mm, limits.slew_mm_per_s * period_s
    for value, before in zip(wanted, previous, strict=True):
        if not (abs(value) <= largest + _ROUNDING_MM and abs(value - before) <= step + _ROUNDING_MM):
            break
    else:  # nearly always
        return LimitedCorrection(wanted_mm, State.OK, "")
    if not all(map(math.isfinite, wanted)):
        return LimitedCorrection(
            previous_mm, State.REFUSED, f"{_first_not_finite(wanted, names)}, refused; the last one is kept"
        )
    beyond = [link for link, value in enumerate(wanted) if abs(value) > largest + _ROUNDING_MM]
    if beyond and limits.on_limit == "refuse":
        return LimitedCorrection(previous_mm, State.REFUSED, _beyond(beyond, wanted, largest, "refused", names))
    allowed = [min(max(value, -largest), largest) for value in wanted]
    late = [i for i, value in enumerate(allowed) if abs(value - previous[i]) > step + _ROUNDING_MM]
    for i in late:
        allowed[i] = previous[i] + math.copysign(step, allowed[i] - previous[i])
    if beyond:
        return LimitedCorrection(np.array(allowed), State.CLAMPED, _beyond(beyond, wanted, largest, "clamped", names))
    return LimitedCorrection(
        np.array(allowed), State.SLEWING, _slewing(late[0], wanted, allowed, limits.slew_mm_per_s, names)
    )


# Distance, mm, at which the rotation moves a point as far as the tip goes, where the limits do not say.
_LEVER_MM = 100.0
_POSE_NUMBERS = ("tip x", "tip y", "tip z", "rotation a", "rotation b", "rotation c")


def limit_pose_correction(
    wanted: FloatArray, previous: FloatArray, period_s: float, limits: LimitSettings
) -> LimitedCorrection:
    """The correction of a pose (6), mm and rad, that may follow `previous` (6), one period later.

    A rotation counts as the length by which it moves a point at the distance where both limits are the same; it slews
    by that length. One that is nan is not known, stays so, and is not limited.
    """
    tip_mm = limits.tip_correction_mm or limits.correction_mm
    lever_mm = _LEVER_MM if limits.rotation_correction_rad is None else tip_mm / limits.rotation_correction_rad
    known = 6 if np.isfinite(wanted[3:]).all() else 3
    previous = np.nan_to_num(previous)
    per_number = np.array([1.0] * 3 + [lever_mm] * 3)[:known]
    limited = limit_correction(
        wanted[:known] * per_number,
        previous[:known] * per_number,
        period_s,
        limits.model_copy(update={"correction_mm": tip_mm}),
        _POSE_NUMBERS,
    )
    if limited.state is State.OK:
        return limited._replace(applied_mm=wanted)
    if limited.state is State.REFUSED:
        return limited._replace(applied_mm=previous)
    applied = np.full(6, math.nan)
    applied[:known] = limited.applied_mm / per_number
    return limited._replace(applied_mm=applied)


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


def _beyond(links: list[int], wanted: list[float], largest: float, action: str, names: Sequence[str]) -> str:
    return "; ".join(
        f"{names[i]}: correction {wanted[i]:.3f} mm beyond {math.copysign(largest, wanted[i]):.3f} mm, {action}"
        for i in links
    )


def _slewing(i: int, wanted: list[float], allowed: list[float], slew_mm_per_s: float, names: Sequence[str]) -> str:
    return f"{names[i]}: correction {wanted[i]:.4f} mm wanted, {allowed[i]:.4f} mm reached at {slew_mm_per_s:g} mm/s"


def _first_not_finite(wanted: list[float], names: Sequence[str]) -> str:
    i = next(i for i, value in enumerate(wanted) if not math.isfinite(value))
    return f"{names[i]}: correction {wanted[i]} is not finite"
