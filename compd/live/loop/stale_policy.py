"""What happens when a comparator is lost: `hold`, `fade` or `stop`, as the configuration says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from compd.arrays import FloatArray
from compd.configuration.operation import LoopSettings
from compd.live.loop.setpoint import State

_NONE: Mapping[str, FloatArray] = {}


class ComparatorSet(NamedTuple):
    """Joint and frame comparators of one snapshot, all good: they are used as a set or not at all.

    change_mm (k + 9): joints, then frame, since machine zero. time_s : of the snapshot. oldest_s : of its
    oldest reading. quantities : those that the model's effects need; they belong to the set.
    """

    change_mm: FloatArray
    time_s: float
    oldest_s: float
    quantities: Mapping[str, FloatArray] = _NONE


class UsableComparators(NamedTuple):
    """The set to compute with; None when there is none and the setpoint is invalid.

    expires_s : monotonic time from which the set must not be used any more; inf for a live one.
    weight : how much the model's effects count, as the set itself does already.
    """

    comparators: ComparatorSet | None
    state: State
    reason: str
    expires_s: float
    weight: float = 1.0


def usable(
    live: ComparatorSet | None, last: ComparatorSet | None, lost: str, now_s: float, loop: LoopSettings
) -> UsableComparators:
    """The live set, or what `on_stale` makes of the last good one.

    live : this cycle's set; None when a comparator is not good, and `lost` then says which and why.
    last : the newest set that was good; None before the first.
    """
    if live is not None:
        return UsableComparators(live, State.OK, "", float("inf"))
    if last is None:
        return UsableComparators(None, State.STARTING, f"no complete set of comparators yet: {lost}", now_s)
    elapsed_s = now_s - last.time_s
    expires_s = last.time_s + loop.hold_s
    if loop.on_stale == "stop":
        return UsableComparators(None, State.STOP, lost, now_s)
    if elapsed_s >= loop.hold_s:
        return UsableComparators(None, State.STOP, f"{lost}; {loop.on_stale} ended after {loop.hold_s:g} s", now_s)
    if loop.on_stale == "hold":
        return UsableComparators(last, State.HOLD, f"{lost}; the last good set is held", expires_s)
    weight = 1.0 - elapsed_s / loop.hold_s
    faded = last._replace(change_mm=last.change_mm * weight)
    return UsableComparators(faded, State.FADE, f"{lost}; the last good set counts {weight:.0%}", expires_s, weight)
