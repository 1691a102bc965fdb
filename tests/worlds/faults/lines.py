"""Faults of lines and devices: a cable out, a device without power, a gateway away; of one line or of all."""

from __future__ import annotations

from collections.abc import Callable

from tests.worlds.faults.away import away
from tests.worlds.faults.fault import Fault
from tests.worlds.faults.layers import Remove, disturb, unplug
from tests.worlds.faults.wiring import line_of, lines_of_scales, wired
from tests.worlds.wires import lost
from tests.worlds.world import World


def cable(world: World, target: str, lasts_s: float) -> Fault:
    """The cable of the line `target` is out for `lasts_s` (s); its displays keep their counts."""
    return away(world, [target], _unplug(world), lasts_s)


def cables_of_scales(world: World, target: str, lasts_s: float) -> Fault:
    """The cables of all scales are out for `lasts_s` (s)."""
    return away(world, lines_of_scales(world), _unplug(world), lasts_s)


def gateway(world: World, target: str, lasts_s: float) -> Fault:
    """A gateway is away: no line of the machine is connected for `lasts_s` (s)."""
    return away(world, list(world.configuration.lines), _unplug(world), lasts_s)


def power(world: World, target: str, away_s: float, stays_s: float) -> Fault:
    """The devices on the line `target` have no power for `away_s` (s), and count from 0 afterwards."""
    channels = [
        channel
        for channel in wired(world.configuration)
        if channel.kind == "scale" and line_of(world, channel.gauge) == target
    ]
    return away(world, [target], lambda line: disturb(world.wires[line], lost), away_s, channels, stays_s=stays_s)


def _unplug(world: World) -> Callable[[str], Remove]:
    return lambda line: unplug(world.wires[line])
