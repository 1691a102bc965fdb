"""What persons do: take machine zero, accept gauges, adopt and release a model, reload the configuration.

Whoever takes machine zero or accepts has looked at the machine before, and mended what is wrong with its gauges.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.support.live_models import file_with
from tests.worlds.faults.fault import Fault, mend
from tests.worlds.world import World

# How often a person looks whether the machine stands, how long it then rests, and how long a person tries, s.
_LOOKS_EVERY_S, _RESTS_S, _PATIENCE_S = 0.1, 0.5, 60.0
_AT_HOME_MM = 1e-6
# From the repair of a gauge to its acceptance, s: it has been read by then.
_ACCEPTS_AFTER_S = 0.5
# Number of an effect that changes a correction by about 1 um: 20 mm from machine zero, 0.1 K from 20 degC, or on the
# way back.
_PER_UM = {"link_zero": 1.0, "scale_gain": 50.0, "link_expansion": 20.0, "backlash": 2.0}


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


def adopt(world: World, target: str, model: str, um: float, shadow: bool) -> Fault:
    """A person adopts a model with one effect, or lets it run as the shadow; "" for none.

    um : by about how much it changes a correction, um.
    """
    world.adopt(_model_file(world, model, um) if model else None, shadow)
    return Fault(world, lasts_s=0.0)


def apply_shadow(world: World, target: str) -> Fault:
    """A person applies the model that runs as the shadow, where there is one."""
    world.clients.apply_shadow()
    return Fault(world, lasts_s=0.0)


def _model_file(world: World, effect: str, um: float) -> Path:
    """A new model file with this effect; it need not be plausible."""
    files = world.directory / "models"
    files.mkdir(exist_ok=True)
    path = files / f"{len(list(files.iterdir())) + 1}-{effect}.yaml"
    geometry = world.configuration.geometry
    return file_with(
        path, effect, name=world.configuration.machine, links=geometry.links, **{effect: _PER_UM[effect] * um}
    )


def release(world: World, target: str) -> Fault:
    """A person takes the controller's role away."""
    world.release()
    return Fault(world, lasts_s=0.0)


def reload(world: World, target: str, key: str, factor: float) -> Fault:
    """A person multiplies a number of the configuration by `factor`, and the daemon reads it again."""
    world.reload(_times(key, factor))
    return Fault(world, lasts_s=0.0)


def reload_refused(world: World, target: str, lasts_s: float) -> Fault:
    """A person writes a limit that cannot be, has the daemon read it, and takes it back `lasts_s` (s) later."""
    path = world.configuration.path
    before = path.read_text()
    world.reload(_times("limits.slew_mm_per_s", -1.0))
    return Fault(world, lambda: path.write_text(before), lasts_s)


def _times(key: str, factor: float) -> Callable[[dict[str, Any]], None]:
    """A change of a configuration's document: the number at `key`, as "limits.slew_mm_per_s", times `factor`."""
    *sections, last = key.split(".")

    def change(document: dict[str, Any]) -> None:
        part = document
        for section in sections:
            part = part[section]
        part[last] *= factor

    return change
