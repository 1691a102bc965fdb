"""The readings of a cycle: comparators by the stale policy, and scales."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from compd.arrays import FloatArray
from compd.live.loop.commands import Target
from compd.live.loop.cycle_state import CycleInputs, CycleSettings
from compd.live.loop.stale_policy import ComparatorSet, UsableComparators, held_comparators, usable_comparators
from compd.live.machine import ALL_GOOD, LiveModel, Lost, WiredValues
from compd.live.memory import Snapshot
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
    """`on_stale: degrade`: each group of gauges fades by itself, and its correction is absent when that has ended.

    The newest good readings of every group, and what to compute with.

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


def read_comparators(
    last_good: ComparatorSet | None,
    inputs: CycleInputs,
    zero_mm: FloatArray,
    applied: LiveModel,
    settings: CycleSettings,
) -> tuple[ComparatorSet | None, UsableComparators]:
    """The live set of this cycle, and the comparators with which to compute."""
    snapshot = inputs.snapshot
    now_s = snapshot.time_s
    if inputs.ending:
        return None, held_comparators(last_good, inputs.ending, now_s, settings.loop)
    wires = settings.wires
    extrapolate = settings.loop.extrapolate
    lengths = wires.comparators.read(snapshot, zero_mm, extrapolate)
    lost, oldest_s = lengths.lost, lengths.oldest_s
    quantities: Mapping[str, FloatArray] = {}
    beyond = None
    if applied.quantities:
        needed = applied.read(snapshot)
        lost = lost.and_also(needed.lost)
        oldest_s = min(oldest_s, needed.oldest_s)
        quantities = applied.by_name(needed)
        beyond = needed.beyond
    if not lost:
        length_times_s = lengths.oldest_s, lengths.newest_s
        drift_mm_per_s: tuple[float, ...] = ()
        if settings.noise is not None:
            drift_mm_per_s = tuple(wires.comparators.speed_bound_mm_per_s(snapshot).tolist())
        live = ComparatorSet(lengths.values, now_s, oldest_s, quantities, (), length_times_s, drift_mm_per_s)
        usable = usable_comparators(live, last_good, lost, now_s, settings.loop)
        return live, usable._replace(beyond=beyond) if beyond else usable
    if settings.loop.on_stale == "degrade":
        groups = (
            wires.joint.read(snapshot, zero_mm[: wires.joints], extrapolate),
            wires.frame.read(snapshot, zero_mm[wires.joints :], extrapolate),
            applied.read(snapshot),
        )
        newest, usable = degraded_comparators(groups, quantities, last_good, now_s, settings.loop)
        return newest, usable._replace(beyond=beyond) if beyond and not groups[2].lost else usable
    return None, usable_comparators(None, last_good, lost, now_s, settings.loop)


def read_scales(snapshot: Snapshot, zero_mm: FloatArray, target: Target | None, settings: CycleSettings) -> WiredValues:
    """The scales (n). In machine-tool mode they are nan, since they are not used; what is lost of them is known where
    they are compared with the setpoints. Where a client gives the pose, effects are computed at the scales."""
    wires = settings.wires.scale
    if target is None or settings.has_own_pose:
        return wires.read(snapshot, zero_mm, settings.loop.extrapolate)
    lost = wires.lost(snapshot) if settings.scales_checked else ALL_GOOD
    return WiredValues(settings.unread_scales_mm, math.inf, -math.inf, lost)


def judge_scales(lost: Lost, compared: bool, seen: bool) -> tuple[State, str]:
    """State and reason of a setpoint by what is lost of the scales.

    compared : whether they are only compared with the setpoints. seen : whether they have ever been good.
    """
    if not lost:
        return State.OK, ""
    if compared:
        return State.FAULT if lost.distrusted else State.DEGRADED, f"not compared with the setpoint: {lost}"
    # no policy replaces a scale: without it the tip is not known
    state = State.FAULT if lost.distrusted else State.STOP if seen else State.STARTING
    return state, f"the tip is not known: {lost}"
