"""What persons do: take machine zero, accept gauges, adopt and release a model, reload the configuration.

Whoever takes machine zero or accepts has looked at the machine before, and mended what is wrong with its gauges.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.worlds.faults.fault import Fault, mend
from tests.worlds.world import World

# How often a person looks whether the machine stands, how long it then rests, and how long a person tries, s.
_LOOKS_EVERY_S, _RESTS_S, _PATIENCE_S = 0.1, 0.5, 60.0
_AT_HOME_MM = 1e-6
# From the repair of a gauge to its acceptance, s: it has been read by then.
_ACCEPTS_AFTER_S = 0.5


def zero(world: World, target: str) -> Fault:
    """A person drives the machine home, and takes machine zero when it rests there."""
    hub, rested_s = world.hub, 0.0

    def look() -> None:
        nonlocal rested_s
        if not fault.present:
            return
        here_mm = world.scale_mm()
        if world.moving:
            rested_s = 0.0
        elif abs(here_mm).max() > _AT_HOME_MM:
            rested_s = 0.0
            world.drive([0.0] * len(here_mm))
        elif (rested_s := rested_s + _LOOKS_EVERY_S) >= _RESTS_S:
            world.take_zero()
            fault.end()
        hub.at(hub.now_s + _LOOKS_EVERY_S, look)

    mend(world)
    fault = Fault(world, lasts_s=_PATIENCE_S)
    look()
    return fault


def accept(world: World, target: str) -> Fault:
    """A person looks at the machine and accepts all gauges."""
    mend(world)
    return Fault(world, world.accept, _ACCEPTS_AFTER_S)


def adopt(world: World, target: str, model: str) -> Fault:
    """A person adopts a model file; "" for none."""
    world.adopt(model or None)
    return Fault(world, lasts_s=0.0)


def release(world: World, target: str) -> Fault:
    """A person releases the model."""
    world.release()
    return Fault(world, lasts_s=0.0)


def reload(world: World, target: str, key: str, factor: float) -> Fault:
    """A person multiplies a number of the configuration by `factor`, and the daemon reads it again."""
    world.reload(_times(key, factor))
    return Fault(world, lasts_s=0.0)


def _times(key: str, factor: float) -> Callable[[dict[str, Any]], None]:
    """A change of a configuration's document: the number at `key`, as "limits.slew_mm_per_s", times `factor`."""
    *sections, last = key.split(".")

    def change(document: dict[str, Any]) -> None:
        part = document
        for section in sections:
            part = part[section]
        part[last] *= factor

    return change
