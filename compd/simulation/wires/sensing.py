"""Connection of simulated devices to the world, by the configuration's wiring."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from compd.configuration import Configuration
from compd.configuration.crosscheck import resolve_channel
from compd.twins.device import Sense

# Source by unit for a channel that is not wired or that the simulated machine does not have; otherwise 0.
_IDLE_SOURCE = {"degC": "temperature_room_degC", "hPa": "pressure_hPa", "pct": "humidity_pct"}


class Sensed(Protocol):
    """What has readings by name: a `World`, or a `LiveWorld`."""

    @property
    def names(self) -> Sequence[str]: ...
    def sense(self, name: str) -> float: ...


class Sensing:
    """Gives each gauge its `Sense`: values of its channels, with the gauge's own sign."""

    def __init__(self, configuration: Configuration, world: Sensed) -> None:
        self._world = world
        wiring = configuration.wiring
        wires = [
            *((f"scale_{wire.link}", wire.gauge, wire.sign) for wire in wiring.scale),
            *((f"joint_{k + 1}", wire.gauge, wire.sign) for k, wire in enumerate(wiring.joint)),
            *((f"frame_{wire.distance}", wire.gauge, wire.sign) for wire in wiring.frame),
            *((wire.name, wire.gauge, 1) for wire in wiring.quantities),
        ]
        wired = {
            resolve_channel(gauge, configuration.gauges, configuration.drivers): (name, sign)
            for name, gauge, sign in wires
        }
        self._sources: dict[str, dict[str, Callable[[], float]]] = {}
        for gauge, driver in configuration.gauge_objects().items():
            self._sources[gauge] = {}
            for channel in driver.channels:
                name, sign = wired.get(f"{gauge}.{channel.name}", ("", 1))
                if name not in world.names:
                    name, sign = _IDLE_SOURCE.get(channel.unit, ""), 1
                self._sources[gauge][channel.name] = self._source(name, sign)

    def of(self, gauge: str) -> Sense:
        """The function by which the simulated device of this gauge asks for its channels' values."""
        sources = self._sources[gauge]
        return lambda channel: sources[channel]()

    def _source(self, name: str, sign: int) -> Callable[[], float]:
        return (lambda: sign * self._world.sense(name)) if name else (lambda: 0.0)
