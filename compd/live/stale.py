"""What happens when a comparator is lost: `hold`, `fade` or `stop`, as the configuration says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from compd.configuration.operation import Loop
from compd.live.setpoint import Array, State

_NONE: Mapping[str, Array] = {}


class Comparators(NamedTuple):
    """Joint and frame comparators of one snapshot, all good: they are used as a set or not at all.

    change_mm (k + 9): joints, then frame, since machine zero. time_s : of the snapshot. oldest_s : of its
    oldest reading. quantities : those that the model's effects need; they belong to the set.
    """

    change_mm: Array
    time_s: float
    oldest_s: float
    quantities: Mapping[str, Array] = _NONE


class Usable(NamedTuple):
    """The set to compute with; None when there is none and the setpoint is invalid.

    expires_s : monotonic time from which the set must not be used any more; inf for a live one.
    weight : how much the model's effects count, as the set itself does already.
    """

    comparators: Comparators | None
    state: State
    reason: str
    expires_s: float
    weight: float = 1.0


def usable(live: Comparators | None, last: Comparators | None, lost: str, now_s: float, loop: Loop) -> Usable:
    """The live set, or what `on_stale` makes of the last good one.

    live : this cycle's set; None when a comparator is not good, and `lost` then says which and why.
    last : the newest set that was good; None before the first.
    """
    if live is not None:
        return Usable(live, State.OK, "", float("inf"))
    if last is None:
        return Usable(None, State.STARTING, f"no complete set of comparators yet: {lost}", now_s)
    elapsed_s = now_s - last.time_s
    expires_s = last.time_s + loop.hold_s
    if loop.on_stale == "stop":
        return Usable(None, State.STOP, lost, now_s)
    if elapsed_s >= loop.hold_s:
        return Usable(None, State.STOP, f"{lost}; {loop.on_stale} ended after {loop.hold_s:g} s", now_s)
    if loop.on_stale == "hold":
        return Usable(last, State.HOLD, f"{lost}; the last good set is held", expires_s)
    weight = 1.0 - elapsed_s / loop.hold_s
    faded = last._replace(change_mm=last.change_mm * weight)
    return Usable(faded, State.FADE, f"{lost}; the last good set counts {weight:.0%}", expires_s, weight)
