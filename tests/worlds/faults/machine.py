"""What a machine does: driven at any speed, jogged, moved while scales are silent or away, stopped by a collision."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np

from compd.errors import CompdError
from compd.simulation.truth.motion import Drives, SetpointMotion, standing
from tests.worlds.faults.away import OLD, away
from tests.worlds.faults.fault import Fault
from tests.worlds.faults.layers import Remove, disturb, unplug
from tests.worlds.faults.wiring import lines_of_scales, names_on, wired
from tests.worlds.wires import lost
from tests.worlds.world import World

# From the loss of the scales to the push, s.
_PUSHED_AFTER_S = 0.1
_FASTEST_MM_PER_S = 1e3
# How often somebody looks whether the machine stands, and how long it then rests, s.
_LOOKS_EVERY_S, _RESTS_S = 0.05, 0.3
# A controller that goes to and fro turns after so long, s; its links are faster than its tip by up to this factor.
_TURNS_AFTER_S, _LINKS_PER_TIP = 2.0, 3.0


def driven(world: World, target: str, to_mm: Sequence[float], mm_per_s: float, mm_per_s2: float | None = None) -> Fault:
    """The links drive to `to_mm` (n) at up to `mm_per_s`, with `mm_per_s2`; None for that of the drive before."""
    _drive(world, np.array(to_mm), _drives(world, mm_per_s, mm_per_s2))
    return Fault(world, lasts_s=0.0)


def jogged(world: World, target: str, by_mm: Sequence[float], mm_per_s: float, mm_per_s2: float | None = None) -> Fault:
    """The links drive by `by_mm` (n)."""
    _drive(world, world.scale_mm() + by_mm, _drives(world, mm_per_s, mm_per_s2))
    return Fault(world, lasts_s=0.0)


def rests(world: World, target: str) -> Fault:
    """The machine stops and rests until it is driven again."""
    _drive(world, world.scale_mm(), _fast(world))
    return Fault(world, lasts_s=0.0)


def moved_while_silent(
    world: World,
    target: str,
    by_mm: Sequence[float],
    mm_per_s: float,
    mm_per_s2: float,
    after_s: float,
    lasts_s: float,
) -> Fault:
    """The machine stops, and the line `target` answers nothing for `lasts_s` (s).

    The links begin to drive by `by_mm` (n) `after_s` (s) after its last answer.
    """
    hub = world.hub
    undo: list[Remove] = []
    fault = Fault(world, lambda: [one() for one in undo], targets=names_on(world, target))

    def begin() -> None:
        if fault.present:
            undo.append(disturb(world.wires[target], lost))
            hub.at(hub.now_s + after_s, depart)
            hub.at(hub.now_s + lasts_s, fault.end)

    def depart() -> None:
        _drive(world, world.scale_mm() + by_mm, Drives(mm_per_s, mm_per_s2))

    rests(world, target)
    _when_it_stands(world, begin)
    return fault


def pushed(world: World, target: str, by_mm: Sequence[float], away_s: float, keeps: bool, stays_s: float) -> Fault:
    """The cables of all scales are out for `away_s` (s), and meanwhile the machine moves by `by_mm` (n).

    keeps : the displays show afterwards what they showed before; else the truth.
    """
    place_mm = world.scale_mm() + by_mm
    world.hub.at(world.hub.now_s + _PUSHED_AFTER_S, lambda: _drive(world, place_mm, _fast(world)))
    channels = [channel for channel in wired(world.configuration) if channel.kind == "scale"] if keeps else []
    lines = lines_of_scales(world)
    return away(world, lines, lambda line: unplug(world.wires[line]), away_s, channels, OLD, stays_s)


def collides(world: World, target: str) -> Fault:
    """The links stop at once, with any acceleration."""
    world.controller.end()
    truth = world.truth
    truth._motion = SetpointMotion(standing(world.scale_mm()), truth._drives)
    return Fault(world, lasts_s=0.0)


def _when_it_stands(world: World, then: Callable[[], object]) -> None:
    """Call a function when the machine has stood for a moment."""
    hub = world.hub

    def look() -> None:
        world.scale_mm()  # moves the truth to the present
        if world.moving:
            hub.at(hub.now_s + _LOOKS_EVERY_S, look)
        else:
            hub.at(hub.now_s + _RESTS_S, then)

    look()


def _drives(world: World, mm_per_s: float, mm_per_s2: float | None) -> Drives:
    return Drives(mm_per_s, world.truth._drives.mm_per_s2 if mm_per_s2 is None else mm_per_s2)


def _fast(world: World) -> Drives:
    """As fast as the drives can go, with the acceleration that they had last."""
    return _drives(world, _FASTEST_MM_PER_S, None)


def controlled(world: World, target: str, to_mm: Sequence[float], mm_per_s: float, lasts_s: float) -> Fault:
    """A controller takes the machine for `lasts_s` (s): it goes there and back again and again.

    to_mm : (n) links at the other end. mm_per_s : of the tip. It ends earlier where the links are driven otherwise.
    """
    hub, controller = world.hub, world.controller
    try:
        ends = [world.truth.tip_for(to_mm), world.truth.tip_for(world.scale_mm().tolist())]
    except CompdError:
        return Fault(world, lasts_s=0.0)
    _set_drives(world, _drives(world, _LINKS_PER_TIP * mm_per_s, None))
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


def _drive(world: World, to_mm: np.ndarray, drives: Drives) -> None:
    """Drive within the limits `drives`; a place beyond the stroke is refused, as a controller does."""
    world.controller.end()
    _set_drives(world, drives)
    with suppress(CompdError):
        world.drive(to_mm.tolist())


def _set_drives(world: World, drives: Drives) -> None:
    """Limits of the links from now on."""
    truth = world.truth
    truth._drives = drives
    if isinstance(truth._motion, SetpointMotion):
        if world.moving:  # links that move are not faster than their drives, and stop within their stroke
            before = truth._motion._drives
            fastest_mm_per_s = float(np.abs(truth._motion.speeds_mm_per_s).max())
            drives = Drives(max(drives.mm_per_s, fastest_mm_per_s), max(drives.mm_per_s2, before.mm_per_s2))
        truth._motion._drives = drives
