"""Several faults of one wire, gauge or process at once: each is a layer, and leaves without the others."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from weakref import WeakKeyDictionary

from tests.worlds.hub import Hub, Lateness, usually_late
from tests.worlds.wires import Fault as Disturbance
from tests.worlds.wires import Wire
from tests.worlds.world import World

# What a gauge's device senses: (channel, true value) -> value, both in the channel's unit.
Distortion = Callable[[str, float], float]
Remove = Callable[[], None]


class _Disturbances:
    """Disturbances of the replies of a wire, applied in the order in which they began."""

    def __init__(self, first: Disturbance) -> None:
        self.layers = [first]

    def __call__(self, reply: bytes) -> Sequence[tuple[float, bytes]]:
        pieces: list[tuple[float, bytes]] = [(0.0, reply)]
        for layer in list(self.layers):
            pieces = [(before + delay, part) for before, piece in pieces for delay, part in layer(piece)]
        return pieces


class _Distortions:
    """Distortions of what a gauge senses, applied in the order in which they began."""

    def __init__(self) -> None:
        self.layers: list[Distortion] = []

    def __call__(self, channel: str, value: float) -> float:
        for layer in self.layers:
            value = layer(channel, value)
        return value


class _Latenesses:
    """Lateness of the wake-ups of a process, added up."""

    def __init__(self, first: Lateness) -> None:
        self.layers = [first]

    def __call__(self, rng: random.Random) -> float:
        return sum(layer(rng) for layer in self.layers)


_OUTAGES: WeakKeyDictionary[Wire, int] = WeakKeyDictionary()


def disturb(wire: Wire, disturbance: Disturbance) -> Remove:
    """Let the replies of a wire be disturbed until the returned function is called."""
    if not isinstance(wire.fault, _Disturbances):
        wire.fault = _Disturbances(wire.fault)
    layers = wire.fault.layers
    layers.append(disturbance)
    return lambda: layers.remove(disturbance)


def distort(world: World, gauge: str, distortion: Distortion) -> Remove:
    """Let a gauge sense other values until the returned function is called."""
    shown = world.shown.get(gauge)
    if not isinstance(shown, _Distortions):
        before, shown = shown, _Distortions()
        if before is not None:
            shown.layers.append(before)
        world.shown[gauge] = shown
    layers = shown.layers
    layers.append(distortion)
    return lambda: layers.remove(distortion)


def delay(hub: Hub, process: str, more: Lateness) -> Remove:
    """Let a process wake later until the returned function is called. more : beside its usual lateness, s."""
    lateness = hub.lateness.get(process, usually_late)
    if not isinstance(lateness, _Latenesses):
        lateness = hub.lateness[process] = _Latenesses(lateness)
    layers = lateness.layers
    layers.append(more)
    return lambda: layers.remove(more)


def unplug(wire: Wire) -> Remove:
    """Take the plug out until the returned function is called; with several outages, until the last ends."""
    _OUTAGES[wire] = _OUTAGES.get(wire, 0) + 1
    if _OUTAGES[wire] == 1:
        wire.unplug()

    def replug() -> None:
        _OUTAGES[wire] -= 1
        if not _OUTAGES[wire]:
            wire.replug()

    return replug


def only(channel: str, change: Callable[[float], float]) -> Distortion:
    """Distortion of one channel of a gauge."""
    return lambda name, value: change(value) if name == channel else value
