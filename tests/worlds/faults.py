"""Faults that a world plays: of one wire, of all scales, of the computer."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

import numpy as np

from tests.worlds.hub import usually_late
from tests.worlds.wires import lost, whole
from tests.worlds.world import ACQUISITION, World

# Of a busy computer: how long it stalls, s, and share of the replies that are lost.
STALL_S = (0.02, 0.3)
LOST_SHARE = 1e-4


def scales(world: World) -> list[str]:
    """Gauges of the scales, in the order of the links."""
    wires = sorted(world.configuration.wiring.scale, key=lambda wire: wire.link)
    return [wire.gauge.partition(".")[0] for wire in wires]


def line_of(world: World, gauge: str) -> str:
    """The line on which a gauge is polled."""
    return world.configuration.gauges[gauge].line


def silence(world: World, line: str, duration_s: float) -> None:
    """The device answers nothing for `duration_s` (s), on a line that stays open."""
    wire = world.wires[line]
    wire.fault = lost
    world.hub.at(world.hub.now_s + duration_s, lambda: setattr(wire, "fault", whole))


def lose_replies(world: World, line: str, count: int) -> None:
    """The next `count` replies are lost."""
    wire, left = world.wires[line], [count]

    def fault(reply: bytes) -> Sequence[tuple[float, bytes]]:
        left[0] -= 1
        if left[0] < 0:
            wire.fault = whole
            return whole(reply)
        return []

    wire.fault = fault


def unplug(world: World, line: str, duration_s: float) -> None:
    """The cable is out for `duration_s` (s)."""
    wire = world.wires[line]
    wire.unplug()
    world.hub.at(world.hub.now_s + duration_s, wire.replug)


def shift(world: World, gauge: str, by: float | Callable[[str], float]) -> None:
    """The gauge shows as much more from now on, in its unit."""
    add = by if callable(by) else lambda _: by
    before = world.shown.get(gauge, lambda _, value: value)
    world.shown[gauge] = lambda channel, value: before(channel, value) + add(channel)


def lose_counts(world: World, was_mm: np.ndarray) -> None:
    """Every scale shows what it showed at `was_mm` (n), wherever the machine is now, and counts on from there."""
    for link, (gauge, mm) in enumerate(zip(scales(world), (was_mm - world.scale_mm()).tolist(), strict=True)):
        sign = world.configuration.wiring.scale[link].sign
        shift(world, gauge, sign * mm)


def keep_busy(world: World, stalls_every_s: float, late_share: float = 0.03, late_s: float = 8e-3) -> None:
    """Other programs compute: some polls are late, replies are lost now and then, and all lines stall for a moment."""
    hub = world.hub

    def lateness(rng: random.Random) -> float:
        return usually_late(rng) + (rng.uniform(0.0, late_s) if rng.random() < late_share else 0.0)

    def stall() -> None:
        hub.pause(ACQUISITION, hub.now_s + hub.rng.uniform(*STALL_S))
        hub.at(hub.now_s + hub.rng.expovariate(1.0 / stalls_every_s), stall)

    hub.lateness[ACQUISITION] = lateness
    for line in world.configuration.lines:
        world.wires[line].fault = lambda reply: [] if hub.rng.random() < LOST_SHARE else whole(reply)
    hub.at(hub.now_s + hub.rng.expovariate(1.0 / stalls_every_s), stall)
