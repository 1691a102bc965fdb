"""Faults of the controller that sends targets: old targets, silence, exchanged links."""

from __future__ import annotations

import numpy as np

from tests.worlds.faults.fault import Fault
from tests.worlds.faults.machine import controlled
from tests.worlds.world import World

# Where nobody controls the machine: the way of each link, mm, the tip's speed, and how long it goes on afterwards, s.
_WAY_MM, _MM_PER_S, _AFTER_S = 5.0, 10.0, 2.0


def old_targets(world: World, target: str, lasts_s: float) -> Fault:
    """The controller repeats its last target for `lasts_s` (s)."""
    _under_control(world, lasts_s)
    world.controller.old(lasts_s)
    return Fault(world, lasts_s=lasts_s)


def silence(world: World, target: str, lasts_s: float) -> Fault:
    """The controller sends no target for `lasts_s` (s)."""
    _under_control(world, lasts_s)
    world.controller.silent(lasts_s)
    return Fault(world, lasts_s=lasts_s)


def exchanged_links(world: World, target: str, links: tuple[int, int], lasts_s: float) -> Fault:
    """The controller exchanges two links, counted from 1, for `lasts_s` (s)."""
    _under_control(world, lasts_s)
    world.controller.exchanged(*links, lasts_s)
    return Fault(world, lasts_s=lasts_s)


def _under_control(world: World, lasts_s: float) -> None:
    """Let a controller have the machine, before and after the fault."""
    if not world.controller.on:
        here_mm = world.scale_mm()
        there_mm = here_mm + np.where(here_mm > 0.0, -_WAY_MM, _WAY_MM)
        controlled(world, "", there_mm.tolist(), _MM_PER_S, lasts_s + _AFTER_S)
