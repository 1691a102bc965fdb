"""What the configuration says of how far its gauges are believed: lengths, and the quantities that effects may read."""

from __future__ import annotations

import math
from typing import Literal

from compd.configuration import Configuration
from compd.live.acquisition import (
    Judge,
    MotionLimits,
    QuantityLimits,
    QuantityTrust,
    ReadingTrust,
    TrustSettings,
    WiredLength,
    quantity_limits,
)
from compd.live.machine import MachineWires, Wire
from compd.live.memory import TrustMemory
from compd.model import MachineModel
from compd.operation_settings import measured_distances
from compd.stated_noise import SAME_VALUE_SIGMAS, tolerance_mm
from compd.units import UM_PER_MM, unit_of


def wired_memory(configuration: Configuration, wires: MachineWires) -> TrustMemory:
    """The memory for the channels that are wired: lengths, then quantities."""
    limits = _quantity_limits(configuration)
    return TrustMemory(
        [wire.channel for wire in wires.all_wires],
        [
            *(tolerance_mm(wire.noise.um) for wire in wires.length_wires),
            # what may change by anything is not worth keeping
            *(
                limits[name].tolerance if math.isfinite(limits[name].fastest_per_s) else math.inf
                for name in wires.quantity_names
            ),
        ],
        [unit_of(name) for name in wires.quantity_names],
        len(wires.scale.wires),
    )


def wired_trust(configuration: Configuration, wires: MachineWires, memory: TrustMemory) -> dict[str, Judge]:
    """The judge of each channel that is wired, by "gauge.channel"."""
    lengths: dict[str, Judge] = {
        wire.channel: ReadingTrust(
            memory, wire.channel, _settings(configuration, wire, is_scale=index < len(wires.scale.wires))
        )
        for index, wire in enumerate(wires.length_wires)
    }
    limits = _quantity_limits(configuration)
    return lengths | {
        channel: QuantityTrust(memory, channel, limits[name]) for name, (channel, _) in wires.quantity_channels.items()
    }


def wired_channels(configuration: Configuration, wires: MachineWires, model: MachineModel) -> list[WiredLength]:
    """What each channel measures, for the votes: lengths, then quantities."""
    wiring = configuration.wiring
    distance_mm = dict(zip(measured_distances(9), model.zero.distances_mm.tolist(), strict=True))
    unknown = math.nan
    parts: list[tuple[Literal["scale", "joint", "frame"], int, str, float]] = [
        *(("scale", link, "", unknown) for link in range(1, len(wiring.scale) + 1)),
        *(("joint", joint.link, joint.role, unknown) for joint in wiring.joint),
        *(("frame", 0, "", distance_mm[distance]) for distance in measured_distances(len(wiring.frame))),
    ]
    lengths = [
        WiredLength(kind, wire.meaning, wire.sign, link, role, length_mm, wire.noise.um / UM_PER_MM)
        for wire, (kind, link, role, length_mm) in zip(wires.length_wires, parts, strict=True)
    ]
    noise = {quantity.name: quantity.noise or unknown for quantity in wiring.quantities}
    return lengths + [WiredLength("quantity", name, 1, 0, "", unknown, noise[name]) for name in wires.quantity_names]


def _quantity_limits(configuration: Configuration) -> dict[str, QuantityLimits]:
    return {quantity.name: quantity_limits(quantity) for quantity in configuration.wiring.quantities}


def _settings(configuration: Configuration, wire: Wire, is_scale: bool) -> TrustSettings:
    gauge = wire.channel.split(".")[0]
    options, driver = configuration.gauges[gauge], configuration.drivers[gauge]
    return TrustSettings(
        MotionLimits(options.fastest_mm_per_s or math.inf, options.acceleration_mm_per_s2 or math.inf),
        options.trust_after_loss or (driver.absolute if options.absolute is None else options.absolute),
        wire.stale_after_s,
        options.restart_s,
        configuration.geometry.scale_signal_period_mm or math.nan if is_scale else math.nan,
        math.inf if math.isnan(wire.noise.um) else SAME_VALUE_SIGMAS * wire.noise.um / UM_PER_MM,
    )
