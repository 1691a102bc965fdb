"""The readings of a cycle: comparators by the stale policy, and scales."""

from __future__ import annotations

import math
from collections.abc import Mapping

from compd.arrays import FloatArray
from compd.live.loop.commands import Target
from compd.live.loop.cycle_state import CycleInputs, CycleSettings
from compd.live.loop.degraded import degraded_comparators
from compd.live.loop.stale_policy import ComparatorSet, UsableComparators, held_comparators, usable_comparators
from compd.live.machine import ALL_GOOD, LiveModel, Lost, WiredValues
from compd.live.memory import Snapshot
from compd.setpoint_states import State


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
