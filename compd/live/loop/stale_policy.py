"""The stale policy: what replaces the comparators when one is lost (`loop.on_stale`: hold, fade or stop).

`degrade`, which replaces them group by group, is in `degraded.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.live.machine import Beyond, Lost
from compd.operation_settings import LoopSettings
from compd.setpoint_states import State

# How long the correction is held, at most, while the daemon ends.
_MAX_END_S = 1.0
_NO_QUANTITIES: Mapping[str, FloatArray] = {}


class ComparatorSet(NamedTuple):
    """Joint and frame comparators of one snapshot, all good. They are used together or not at all."""

    change_mm: FloatArray  #: (k + 9), joints, then frame, since machine zero
    time_s: float  #: monotonic time of the snapshot
    oldest_s: float  #: monotonic time of the oldest reading in the set
    #: temperatures, forces and the rest that the effects of the applied model need
    quantities: Mapping[str, FloatArray] = _NO_QUANTITIES
    #: monotonic times from which joints, frame and quantities are, where they differ; else empty
    group_times_s: tuple[float, ...] = ()
    #: monotonic times of the oldest and of the newest reading of a length; empty where that is not known
    length_times_s: tuple[float, ...] = ()
    #: (k + 9), how fast each moved at most; empty where the bound of the tip's error is not computed, and in a
    #: recording of a release up to 0.2.0.
    drift_mm_per_s: tuple[float, ...] = ()
    #: (n), where the scales were commanded without compensation; empty where that is not known
    scale_mm: tuple[float, ...] = ()


class UsableComparators(NamedTuple):
    """The comparators with which to compute."""

    comparators: ComparatorSet | None  #: None where there are none to use; the setpoint is then invalid
    state: State  #: state, reason: OK and "", or what replaces the lost comparators and why
    reason: str
    expires_s: float  #: monotonic time from which `comparators` must not be used any more; inf where they are live
    #: factor between 0 and 1 by which the corrections of the effects are multiplied. `comparators` have been multiplied
    #: by it already.
    weight: float = 1.0
    #: (k + 9), for how long each comparator that is taken from the last good set has not been read; 0 for one that is
    #: live. None where all are.
    held_s: FloatArray | None = None
    absent_mm: FloatArray | None = None  #: (k + 9), what the comparators showed and is not used; None for nothing
    #: which quantities are beyond the range in which the effects were fitted; None for none
    beyond: Beyond | None = None


def usable_comparators(
    live: ComparatorSet | None, last_good: ComparatorSet | None, lost: Lost, now_s: float, settings: LoopSettings
) -> UsableComparators:
    """The live set, or what `on_stale` makes of the last good one.

    `hold` uses the last good set as it is, `fade` multiplies it by 1 - elapsed / hold_s; both end after `hold_s`.

    Parameters
    ----------
    live : the set of this cycle; None when a comparator cannot be used.
    last_good : the newest complete set; None before the first.
    lost : which comparators cannot be used, and why. Where a person has to accept one, the state is `fault` instead of
        `stop`.
    now_s : monotonic time of the snapshot.
    """
    if live is not None:
        return UsableComparators(live, State.OK, "", float("inf"))
    if last_good is None:
        return UsableComparators(None, State.STARTING, f"no complete set of comparators yet: {lost}", now_s)
    ended = State.FAULT if lost.distrusted else State.STOP
    elapsed_s = now_s - last_good.time_s
    expires_s = last_good.time_s + settings.hold_s
    if settings.on_stale == "stop":
        return UsableComparators(None, ended, str(lost), now_s)
    if elapsed_s >= settings.hold_s:
        reason = f"{settings.on_stale} ended after {settings.hold_s:g} s; {lost}"
        return UsableComparators(None, ended, reason, now_s)
    if settings.on_stale == "hold":
        return _held(last_good, f"{lost}; the last good set is held", expires_s, now_s)
    weight = 1.0 - elapsed_s / settings.hold_s
    known_mm = last_good.change_mm
    faded = _held(last_good, f"{lost}; the last good set counts {weight:.0%}", expires_s, now_s)
    return faded._replace(
        comparators=last_good._replace(change_mm=known_mm * weight),
        state=State.FADE,
        weight=weight,
        absent_mm=known_mm * (1.0 - weight),
    )


def _held(last_good: ComparatorSet, reason: str, expires_s: float, now_s: float) -> UsableComparators:
    held_s = np.full(len(last_good.change_mm), now_s - last_good.oldest_s)
    return UsableComparators(last_good, State.HOLD, reason, expires_s, held_s=held_s)


def held_comparators(
    last_good: ComparatorSet | None, why: str, now_s: float, settings: LoopSettings
) -> UsableComparators:
    """The last good set while the daemon ends, which takes a moment; a set that was old before as `on_stale` has it.

    why : the daemon ends. now_s : monotonic time of the snapshot.
    """
    if last_good is None or now_s - last_good.time_s > _MAX_END_S:
        return usable_comparators(None, last_good, Lost(why), now_s, settings)
    expires_s = last_good.time_s + _MAX_END_S
    return _held(last_good, f"{why}; the last good set is held", expires_s, now_s)
