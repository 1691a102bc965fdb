"""Names of gauges, lines and channels of a world's machine."""

from __future__ import annotations

from typing import NamedTuple

from compd.configuration import Configuration, resolve_channel
from tests.worlds.world import World


class Wired(NamedTuple):
    """A wired channel.

    kind : "scale", "joint", "frame" or "quantity". source : name of what it measures in the simulated truth.
    sign : of the wire.
    """

    gauge: str
    channel: str
    kind: str
    source: str
    sign: int

    @property
    def name(self) -> str:
        return f"{self.gauge}.{self.channel}"


def wired(configuration: Configuration) -> list[Wired]:
    """Every wired channel of a machine, scales first in the order of the links."""
    wiring = configuration.wiring
    rows = [
        *((w.gauge, "scale", f"scale_{w.link}", w.sign) for w in sorted(wiring.scale, key=lambda w: w.link)),
        *((w.gauge, "joint", f"joint_{k + 1}", w.sign) for k, w in enumerate(wiring.joint)),
        *((w.gauge, "frame", f"frame_{w.distance}", w.sign) for w in wiring.frame),
        *((w.gauge, "quantity", w.name, 1) for w in wiring.quantities),
    ]
    channels = []
    for name, kind, source, sign in rows:
        whole = resolve_channel(name, configuration.gauges, configuration.drivers)
        assert whole is not None, name
        gauge, _, channel = whole.partition(".")
        channels.append(Wired(gauge, channel, kind, source, sign))
    return channels


def true_value(world: World, channel: Wired) -> float:
    """What a channel shows without a fault now, in its unit."""
    world.scale_mm()  # moves the truth to the present
    names = world.truth.names
    if channel.source not in names:
        return 0.0
    sense = world.truth.sense_scale if channel.kind == "scale" else world.truth.sense
    return channel.sign * sense(channel.source)


def scales(world: World) -> list[str]:
    """Gauges of the scales, in the order of the links."""
    return [channel.gauge for channel in wired(world.configuration) if channel.kind == "scale"]


def line_of(world: World, gauge: str) -> str:
    """The line on which a gauge is polled."""
    return world.configuration.gauges[gauge].line


def lines_of_scales(world: World) -> list[str]:
    """Lines that poll scales, each once."""
    return list(dict.fromkeys(line_of(world, gauge) for gauge in scales(world)))


def names_on(world: World, *lines: str) -> tuple[str, ...]:
    """Names of lines and of the gauges that they poll."""
    gauges = (name for name, options in world.configuration.gauges.items() if options.line in lines)
    return (*lines, *gauges)
