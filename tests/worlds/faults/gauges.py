"""Faults of what gauges show: jumps, stuck digits, creep, lost counts, direction, unit, another value after a loss.

What stays wrong is mended after a time, or when a person looks at the machine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from operator import add

import numpy as np

from tests.worlds.faults.away import FROM_ZERO, OLD, away
from tests.worlds.faults.fault import Fault
from tests.worlds.faults.layers import Distortion, distort, only, unplug
from tests.worlds.faults.machine import driven
from tests.worlds.faults.wiring import line_of, wired
from tests.worlds.world import World

MM_PER_INCH = 25.4


def jump(world: World, target: str, by: float, lasts_s: float) -> Fault:
    """The channel `target` shows more by `by`, in its unit."""
    return _wrong(world, target, lasts_s, lambda value: value + by)


def step(world: World, target: str, by: float, lasts_s: float) -> Fault:
    """The scale `target` shows more by `by` (mm), which is small: a particle, a slipped clamp."""
    return jump(world, target, by, lasts_s)


def jump_in_motion(
    world: World,
    target: str,
    to_mm: Sequence[float],
    mm_per_s: float,
    mm_per_s2: float,
    after_s: float,
    by: float,
    lasts_s: float,
) -> Fault:
    """The links drive, as in `machine.driven`; `after_s` (s) later the scale `target` shows more by `by` (mm)."""
    driven(world, target, to_mm, mm_per_s, mm_per_s2)
    hub, jumps_s = world.hub, world.hub.now_s + after_s
    return _wrong(world, target, after_s + lasts_s, lambda value: value + by * (hub.now_s >= jumps_s))


def thermometer_jump(world: World, target: str, by: float, lasts_s: float) -> Fault:
    """The thermometer `target` shows more by `by` (K)."""
    return jump(world, target, by, lasts_s)


def stick(world: World, target: str, lasts_s: float) -> Fault:
    """The channel `target` shows the same digits."""
    kept: list[float] = []

    def first(value: float) -> float:
        if not kept:
            kept.append(value)
        return kept[0]

    return _wrong(world, target, lasts_s, first)


def creep(world: World, target: str, per_s: float, creeps_s: float, lasts_s: float) -> Fault:
    """The channel `target` drifts by `per_s`, in its unit, for `creeps_s` (s), and stays there."""
    hub, began_s = world.hub, world.hub.now_s
    return _wrong(world, target, lasts_s, lambda value: value + per_s * min(hub.now_s - began_s, creeps_s))


def lost_counts(world: World, target: str, quarters: int, lasts_s: float) -> Fault:
    """The scale `target` has lost `quarters` of its signal period."""
    period_mm = world.configuration.geometry.scale_signal_period_mm or 0.02
    return jump(world, target, quarters * period_mm / 4, lasts_s)


def direction(world: World, target: str, lasts_s: float) -> Fault:
    """The channel `target` counts the other way from now on."""
    turned_at: list[float] = []

    def turned(value: float) -> float:
        if not turned_at:
            turned_at.append(value)
        return 2 * turned_at[0] - value

    return _wrong(world, target, lasts_s, turned)


def unit(world: World, target: str, lasts_s: float) -> Fault:
    """The channel `target` shows inches in place of millimetres."""
    return _wrong(world, target, lasts_s, lambda value: value / MM_PER_INCH)


def returns(world: World, target: str, shows: str, by: float, away_s: float, lasts_s: float) -> Fault:
    """The line of the channel `target` is away for `away_s` (s).

    shows : afterwards the channel counts on from its "old" value, from "zero", or from the true one and `by` ("other").
    """
    channel = next(channel for channel in wired(world.configuration) if channel.name == target)
    more = {"old": OLD, "zero": FROM_ZERO, "other": lambda before, after: by}[shows]
    lines = [line_of(world, channel.gauge)]
    return away(world, lines, lambda line: unplug(world.wires[line]), away_s, [channel], more, lasts_s)


def _wrong(world: World, target: str, lasts_s: float, change: Callable[[float], float]) -> Fault:
    """One channel shows something else for `lasts_s` (s), or until a person looks."""
    gauge, _, channel = target.partition(".")
    remove = distort(world, gauge, only(channel, change))
    return Fault(world, remove, lasts_s, mendable=True, targets=(gauge, line_of(world, gauge)))


# --- for tests that need one moment ------------------------------------------------------------------------------


def shift(world: World, gauge: str, by: float | Distortion) -> None:
    """The gauge shows more by `by` from now on, in its unit."""
    change = by if callable(by) else lambda _, value: value + by
    distort(world, gauge, change)


def lose_counts(world: World, was_mm: np.ndarray) -> None:
    """Every scale shows what it showed at `was_mm` (n), wherever the machine is now, and counts on from there."""
    channels = [channel for channel in wired(world.configuration) if channel.kind == "scale"]
    for channel, mm in zip(channels, (was_mm - world.scale_mm()).tolist(), strict=True):
        distort(world, channel.gauge, only(channel.channel, partial(add, channel.sign * mm)))
