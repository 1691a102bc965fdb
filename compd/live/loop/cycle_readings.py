"""The readings of a cycle: comparators by the stale policy, and scales."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from compd.arrays import FloatArray
from compd.live.loop.commands import Target
from compd.live.loop.cycle_state import CycleInputs, CycleSettings
from compd.live.loop.degraded import GroupReadings, degraded_comparators
from compd.live.loop.model_loader import LiveModel
from compd.live.loop.stale_policy import ComparatorSet, UsableComparators, held_comparators, usable_comparators
from compd.live.loop.wiring import Wires
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
            _group(wires.joint, snapshot, zero_mm[: wires.joints], extrapolate),
            _group(wires.frame, snapshot, zero_mm[wires.joints :], extrapolate),
            _quantity_group(applied, snapshot),
        )
        newest, usable = degraded_comparators(groups, quantities, last_good, now_s, settings.loop)
        return newest, usable._replace(beyond=beyond) if beyond and not groups[2].lost else usable
    return None, usable_comparators(None, last_good, lost, now_s, settings.loop)


def _group(wires: Wires, snapshot: Snapshot, zero_mm: FloatArray, extrapolate: bool) -> GroupReadings:
    values, oldest_s, newest_s, lost, _ = wires.read(snapshot, zero_mm, extrapolate)
    return GroupReadings(values, lost, oldest_s, newest_s)


def _quantity_group(applied: LiveModel, snapshot: Snapshot) -> GroupReadings:
    needed = applied.read(snapshot)
    return GroupReadings(needed.values, needed.lost, needed.oldest_s, needed.newest_s)


class Scales(NamedTuple):
    """The scales of a cycle: values (n) in mm since machine zero, and the times of the oldest and the newest reading.

    state, reason : where they make the setpoint invalid or worse than it were; None and "" otherwise.
    """

    values: FloatArray
    oldest_s: float
    newest_s: float
    state: State | None = None
    reason: str = ""


def read_scales(
    snapshot: Snapshot, zero_mm: FloatArray, target: Target | None, seen: bool, settings: CycleSettings
) -> Scales:
    """The scales in CMM mode. In machine-tool mode they are not used, but they may be compared with the setpoints."""
    wires = settings.wires.scale
    if target is not None:
        unread = Scales(settings.unread_scales_mm, math.inf, -math.inf)
        if not (settings.scales_checked and (lost := wires.lost(snapshot))):
            return unread
        state = State.FAULT if lost.distrusted else State.DEGRADED
        return unread._replace(state=state, reason=f"not compared with the setpoint: {lost}")
    values, oldest_s, newest_s, lost, _ = wires.read(snapshot, zero_mm, settings.loop.extrapolate)
    if not lost:
        return Scales(values, oldest_s, newest_s)
    # no policy replaces a scale: without it the tip is not known
    state = State.FAULT if lost.distrusted else State.STOP if seen else State.STARTING
    return Scales(values, oldest_s, newest_s, state, f"the tip is not known: {lost}")
