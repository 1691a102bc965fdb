"""From a configuration to what computes its setpoints; the daemon and replay build it here, so it is the same."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from compd.configuration import Configuration
from compd.gauge import Gauge
from compd.live.loop.cycle import Cycle
from compd.live.loop.model_loader import ModelLoader
from compd.live.loop.tip_uncertainty import declared_noise
from compd.live.loop.wiring import MachineWires
from compd.machine_builder import build_model
from compd.readings import Latest


class Pipeline(NamedTuple):
    """Readings go into `latest`; `wires` say what they measure; `cycle` makes setpoints of its snapshots, with the
    models that `shelf` reads."""

    latest: Latest
    wires: MachineWires
    cycle: Cycle
    shelf: ModelLoader


def build_pipeline(configuration: Configuration, gauges: Mapping[str, Gauge[Any]]) -> Pipeline:
    """`gauges`: the configuration's own, by name. Raises KinematicsError for a machine that cannot be."""
    latest = Latest([f"{name}.{channel.name}" for name, gauge in gauges.items() for channel in gauge.channels])
    wires = MachineWires(configuration, latest)
    model = build_model(configuration.geometry, configuration.wiring)
    cycle = Cycle(
        model,
        wires,
        configuration.loop,
        configuration.limits,
        configuration.sockets.valid_for_s,
        configuration.geometry.link_length_mm,
        declared_noise(configuration),
    )
    return Pipeline(latest, wires, cycle, ModelLoader(model, configuration.machine, configuration.geometry_hash, wires))
