"""Clients that disturb others: one that does not read, one that asks without end, one that goes within a line."""

from __future__ import annotations

from tests.worlds.faults.fault import Fault
from tests.worlds.world import World

_LINES = {
    "request": b'{"class": "STATUS"}\n',
    "target": b'{"class": "TARGET", "tip_B0_mm": [0, 0, 0]}\n',
    "noise": b"\xff\x00{" * 999,
}


def slow(world: World, target: str, lasts_s: float) -> Fault:
    """A client watches all readings and reads nothing for `lasts_s` (s)."""
    world.clients.does_not_read(lasts_s)
    return Fault(world, lasts_s=lasts_s)


def flood(world: World, target: str, per_s: float, lasts_s: float) -> Fault:
    """A client sends `per_s` requests a second for `lasts_s` (s)."""
    world.clients.floods(per_s, lasts_s)
    return Fault(world, lasts_s=lasts_s)


def half_line(world: World, target: str, what: str) -> Fault:
    """A client goes within a line: a "request", a "target" or "noise"."""
    world.clients.goes_within_a_line(_LINES[what])
    return Fault(world, lasts_s=0.0)
