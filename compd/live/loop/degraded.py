"""`on_stale: degrade`: each group of gauges fades by itself, and its correction is absent when that has ended."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from compd.arrays import FloatArray
from compd.live.loop.stale_policy import ComparatorSet, UsableComparators
from compd.live.machine import WiredValues
from compd.operation_settings import LoopSettings
from compd.setpoint_states import State

GROUPS = ("joints", "frame", "effects")


def degraded_comparators(
    groups: tuple[WiredValues, WiredValues, WiredValues],
    quantities: Mapping[str, FloatArray],
    last_good: ComparatorSet | None,
    now_s: float,
    settings: LoopSettings,
) -> tuple[ComparatorSet | None, UsableComparators]:
    """The newest good readings of every group, and what to compute with.

    Parameters
    ----------
    groups : joints, frame and quantities, of which one or more are lost.
    quantities : by name, where they are good.
    last_good : what this has returned in the cycle before, or the last complete set; None before the first.
    now_s : monotonic time of the snapshot.
    """
    lost = groups[0].lost.and_also(groups[1].lost).and_also(groups[2].lost)
    if last_good is None:
        return None, UsableComparators(None, State.STARTING, f"no complete set of comparators yet: {lost}", now_s)
    joints = len(groups[0].values)
    before_s = last_good.group_times_s or (last_good.time_s,) * 3
    times_s = tuple(before if group.lost else now_s for group, before in zip(groups, before_s, strict=True))
    weights = [max(0.0, 1.0 - (now_s - time_s) / settings.hold_s) for time_s in times_s]
    known_mm = np.concatenate(
        [
            last_good.change_mm[:joints] if groups[0].lost else groups[0].values,
            last_good.change_mm[joints:] if groups[1].lost else groups[1].values,
        ]
    )
    by_gauge = np.repeat(weights[:2], (joints, len(known_mm) - joints))
    newest = ComparatorSet(
        known_mm,
        last_good.time_s,
        min(last_good.oldest_s, *(group.oldest_s for group in groups)),
        last_good.quantities if groups[2].lost else quantities,
        times_s,
        _length_times_s(groups[:2], weights, last_good),
        last_good.drift_mm_per_s,
        last_good.scale_mm,
    )
    absent = [name for name, weight in zip(GROUPS, weights, strict=True) if weight == 0.0]
    fading = [f"{name} count {weight:.0%}" for name, weight in zip(GROUPS, weights, strict=True) if 0.0 < weight < 1.0]
    what = [*([f"the correction of {_listed(absent)} is absent"] if absent else []), *fading]
    live_s = [group.oldest_s for group in groups if not group.lost]
    used_s = min(
        [*live_s, *(time_s for time_s, weight in zip(times_s, weights, strict=True) if 0.0 < weight < 1.0)],
        default=now_s,
    )
    since_s = [newest.oldest_s if group.lost else now_s for group in groups[:2]]
    usable = UsableComparators(
        newest._replace(change_mm=known_mm * by_gauge, oldest_s=used_s),
        State.DEGRADED if absent and not fading else State.FADE,
        f"{lost}; {'; '.join(what)}",
        math.inf,
        weights[2],
        now_s - np.repeat(since_s, (joints, len(known_mm) - joints)),
        (1.0 - by_gauge) * known_mm,
    )
    return newest, usable


def _length_times_s(
    lengths: tuple[WiredValues, ...], weights: list[float], last_good: ComparatorSet
) -> tuple[float, ...]:
    """Times of the oldest and of the newest length that counts: live, or of the last good set and not yet absent."""
    times_s = [time_s for group in lengths if not group.lost for time_s in (group.oldest_s, group.newest_s)]
    if any(group.lost and weight > 0.0 for group, weight in zip(lengths, weights, strict=False)):
        if not last_good.length_times_s:
            return ()
        times_s += last_good.length_times_s
    return (min(times_s), max(times_s)) if times_s else ()


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
