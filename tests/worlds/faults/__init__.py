"""Faults that a world plays, one file for each family.

Each kind is a function of a world, its target and its parameters, and returns a `Fault` that knows when it has ended.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import Any

from tests.worlds.faults import clients, computer, controller, gauges, lines, machine, persons, replies
from tests.worlds.faults.fault import Fault
from tests.worlds.world import World

FAMILIES: Mapping[str, ModuleType] = {
    family.__name__.rpartition(".")[2]: family
    for family in (replies, lines, gauges, computer, controller, machine, persons, clients)
}


def begin(world: World, family: str, kind: str, target: str, parameters: Mapping[str, Any]) -> Fault:
    """Begin a fault of a kind now."""
    fault: Fault = getattr(FAMILIES[family], kind)(world, target, **parameters)
    return fault
