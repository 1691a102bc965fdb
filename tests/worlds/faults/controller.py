"""Faults of the controller that sends targets: old targets, silence, exchanged links."""

from __future__ import annotations

from tests.worlds.faults.fault import Fault
from tests.worlds.world import World


def old_targets(world: World, target: str, lasts_s: float) -> Fault:
    """The controller repeats its last target for `lasts_s` (s)."""
    world.controller.old(lasts_s)
    return Fault(world, lasts_s=lasts_s)


def silence(world: World, target: str, lasts_s: float) -> Fault:
    """The controller sends no target for `lasts_s` (s)."""
    world.controller.silent(lasts_s)
    return Fault(world, lasts_s=lasts_s)


def exchanged_links(world: World, target: str, links: tuple[int, int], lasts_s: float) -> Fault:
    """The controller exchanges two links, counted from 1, for `lasts_s` (s)."""
    world.controller.exchanged(*links, lasts_s)
    return Fault(world, lasts_s=lasts_s)
