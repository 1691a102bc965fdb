"""What the configuration says of how far its length gauges are believed."""

from __future__ import annotations

import math
from typing import Literal

from compd.configuration import Configuration
from compd.configuration.operation import FRAME_DISTANCES
from compd.configuration.stated_noise import tolerance_mm
from compd.live.acquisition.possible_motion import MotionLimits
from compd.live.acquisition.reading_trust import ReadingTrust, TrustSettings
from compd.live.acquisition.votes.machine_view import WiredLength
from compd.live.loop.wiring import MachineWires, Wire
from compd.live.memory.trust_memory import TrustMemory
from compd.model.machine import MachineModel


def length_memory(configuration: Configuration, wires: MachineWires) -> TrustMemory:
    """The memory for the length channels that are wired."""
    return TrustMemory(wires.length_channels, [tolerance_mm(wire.noise.um) for wire in wires.length_wires])


def length_trust(configuration: Configuration, wires: MachineWires, memory: TrustMemory) -> dict[str, ReadingTrust]:
    """The judge of each length channel that is wired, by "gauge.channel"."""
    return {
        wire.channel: ReadingTrust(memory, wire.channel, _settings(configuration, wire)) for wire in wires.length_wires
    }


def wired_lengths(configuration: Configuration, wires: MachineWires, model: MachineModel) -> list[WiredLength]:
    """What each length channel measures, for the votes."""
    wiring = configuration.wiring
    distance_mm = dict(zip(FRAME_DISTANCES, model.zero.distances_mm.tolist(), strict=True))
    unknown = math.nan
    parts: list[tuple[Literal["scale", "joint", "frame"], int, str, float]] = [
        *(("scale", link, "", unknown) for link in range(1, len(wiring.scale) + 1)),
        *(("joint", joint.link, joint.role, unknown) for joint in wiring.joint),
        *(("frame", 0, "", distance_mm[distance]) for distance in FRAME_DISTANCES),
    ]
    return [
        WiredLength(kind, wire.meaning, wire.sign, link, role, length_mm, wire.noise.um)
        for wire, (kind, link, role, length_mm) in zip(wires.length_wires, parts, strict=True)
    ]


def _settings(configuration: Configuration, wire: Wire) -> TrustSettings:
    gauge = wire.channel.split(".")[0]
    options, driver = configuration.gauges[gauge], configuration.drivers[gauge]
    return TrustSettings(
        MotionLimits(options.fastest_mm_per_s or math.inf, options.acceleration_mm_per_s2 or math.inf),
        options.trust_after_loss or (driver.absolute if options.absolute is None else options.absolute),
        wire.stale_after_s,
    )
