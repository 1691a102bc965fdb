"""What a machine does: driven at any speed, jogged, pushed while its scales are away, stopped by a collision."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compd.errors import CompdError
from compd.simulation.truth.motion import Drives, SetpointMotion, standing
from tests.worlds.faults.away import OLD, away
from tests.worlds.faults.fault import Fault
from tests.worlds.faults.layers import unplug
from tests.worlds.faults.wiring import lines_of_scales, wired
from tests.worlds.world import World

# From the loss of the scales to the push, s.
_PUSHED_AFTER_S = 0.1
# A controller that goes to and fro turns after so long, s; its links are faster than its tip by up to this factor.
_TURNS_AFTER_S, _LINKS_PER_TIP = 2.0, 3.0


def driven(world: World, target: str, to_mm: Sequence[float], mm_per_s: float) -> Fault:
    """The links drive to `to_mm` (n); the longest at `mm_per_s`."""
    _drive(world, np.array(to_mm), mm_per_s)
    return Fault(world, lasts_s=0.0)


def jogged(world: World, target: str, by_mm: Sequence[float], mm_per_s: float) -> Fault:
    """The links drive by `by_mm` (n)."""
    _drive(world, world.scale_mm() + by_mm, mm_per_s)
    return Fault(world, lasts_s=0.0)


def rests(world: World, target: str) -> Fault:
    """The machine stops and rests until it is driven again."""
    _drive(world, world.scale_mm(), 1e3)
    return Fault(world, lasts_s=0.0)


def pushed(world: World, target: str, by_mm: Sequence[float], away_s: float, keeps: bool, stays_s: float) -> Fault:
    """The cables of all scales are out for `away_s` (s), and meanwhile the machine moves by `by_mm` (n).

    keeps : the displays show afterwards what they showed before; else the truth.
    """
    place_mm = world.scale_mm() + by_mm
    world.hub.at(world.hub.now_s + _PUSHED_AFTER_S, lambda: _drive(world, place_mm, 1e3))
    channels = [channel for channel in wired(world.configuration) if channel.kind == "scale"] if keeps else []
    lines = lines_of_scales(world)
    return away(world, lines, lambda line: unplug(world.wires[line]), away_s, channels, OLD, stays_s)


def collides(world: World, target: str) -> Fault:
    """The links stop at once, with any acceleration."""
    world.controller.end()
    truth = world.truth
    truth._motion = SetpointMotion(standing(world.scale_mm()), truth._drives)
    return Fault(world, lasts_s=0.0)


def controlled(world: World, target: str, to_mm: Sequence[float], mm_per_s: float, lasts_s: float) -> Fault:
    """A controller takes the machine for `lasts_s` (s): it goes there and back again and again.

    to_mm : (n) links at the other end. mm_per_s : of the tip. It ends earlier where the links are driven otherwise.
    """
    hub, controller = world.hub, world.controller
    try:
        ends = [world.truth.tip_for(to_mm), world.truth.tip_for(world.scale_mm().tolist())]
    except CompdError:
        return Fault(world, lasts_s=0.0)
    _set_speed(world, _LINKS_PER_TIP * mm_per_s)
    turn = controller.begin(ends[1])

    def go() -> None:
        if controller.turn == turn:
            controller.go(ends[0], mm_per_s)
            ends.reverse()
            hub.at(hub.now_s + _TURNS_AFTER_S, go)

    def end() -> None:
        if controller.turn == turn:
            controller.end()

    fault = Fault(world, end, lasts_s)
    go()
    return fault


def _drive(world: World, to_mm: np.ndarray, mm_per_s: float) -> None:
    """Drive at up to `mm_per_s`; a place beyond the stroke is refused, as a controller does."""
    world.controller.end()
    _set_speed(world, mm_per_s)
    try:
        world.drive(to_mm.tolist())
    except CompdError:
        return


def _set_speed(world: World, mm_per_s: float) -> None:
    truth = world.truth
    truth._drives = Drives(mm_per_s, truth._drives.mm_per_s2)
    if isinstance(truth._motion, SetpointMotion):
        # the speed that a link has is at most that of its drives
        truth._motion._drives = Drives(max(mm_per_s, *np.abs(truth._motion.speeds_mm_per_s)), truth._drives.mm_per_s2)
