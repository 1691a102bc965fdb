"""What the configuration says of how far its length gauges are believed."""

from __future__ import annotations

import math

from compd.configuration import Configuration
from compd.live.acquisition.possible_motion import MotionLimits
from compd.live.acquisition.reading_trust import ReadingTrust, TrustSettings, tolerance_mm
from compd.live.loop.wiring import MachineWires, Wire
from compd.live.memory.trust_memory import TrustMemory


def length_memory(configuration: Configuration, wires: MachineWires) -> TrustMemory:
    """The memory for the length channels that are wired."""
    gauges = configuration.gauges
    channels = wires.length_channels
    return TrustMemory(channels, [tolerance_mm(gauges[channel.split(".")[0]].noise_um) for channel in channels])


def length_trust(configuration: Configuration, wires: MachineWires, memory: TrustMemory) -> dict[str, ReadingTrust]:
    """The judge of each length channel that is wired, by "gauge.channel"."""
    return {
        wire.channel: ReadingTrust(memory, wire.channel, _settings(configuration, wire)) for wire in wires.length_wires
    }


def _settings(configuration: Configuration, wire: Wire) -> TrustSettings:
    gauge = wire.channel.split(".")[0]
    options, driver = configuration.gauges[gauge], configuration.drivers[gauge]
    return TrustSettings(
        MotionLimits(options.fastest_mm_per_s or math.inf, options.acceleration_mm_per_s2 or math.inf),
        options.trust_after_loss or (driver.absolute if options.absolute is None else options.absolute),
        wire.stale_after_s,
    )
