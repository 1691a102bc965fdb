"""What computes the setpoints of a configuration, built in the same way for the daemon and for a replay."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import chain
from typing import Any, NamedTuple

from compd.configuration import Configuration
from compd.gauge import Gauge
from compd.live.loop.cycle_state import CycleSettings
from compd.live.loop.tip_uncertainty import stated_noise
from compd.live.machine import MachineWires, ModelLoader, Models
from compd.live.memory import Latest
from compd.machine_builder import build_model
from compd.model.external import ExternalModel, Kinematics
from compd.plugins import OWN_CODE, Code


class Pipeline(NamedTuple):
    """What a configuration's setpoints are computed with.

    latest : where the readings of every channel go. settings : of the cycle. loader : of model files.
    """

    latest: Latest
    settings: CycleSettings
    loader: ModelLoader

    @property
    def wires(self) -> MachineWires:
        """What each channel measures."""
        return self.settings.wires


def build_pipeline(
    configuration: Configuration,
    gauges: Mapping[str, Gauge[Any]],
    code: Code = OWN_CODE,
    watch: Callable[[Kinematics], Kinematics] | None = None,
) -> Pipeline:
    """`gauges`: those of the configuration, by name; `code`: which Python files effects may be in. `watch` makes of
    own kinematics what is called in its place.

    Raises KinematicsError for a geometry that is impossible.
    """
    channels = {name: [f"{name}.{channel.name}" for channel in gauge.channels] for name, gauge in gauges.items()}
    latched = [
        [channel for name in channels if configuration.gauges[name].line == line for channel in channels[name]]
        for line, settings in configuration.lines.items()
        if settings.round_trigger is not None
    ]
    latest = Latest(list(chain.from_iterable(channels.values())), latched)
    wires = MachineWires(configuration, latest)
    model = build_model(configuration.geometry, configuration.wiring)
    if watch is not None and isinstance(model, ExternalModel) and model.own is not None:
        model = replace(model, own=watch(model.own))
    loader = ModelLoader(model, configuration.machine, configuration.geometry_hash, wires, code)
    settings = CycleSettings(
        without_effects=Models(loader.without_effects),
        wires=wires,
        loop=configuration.loop,
        limits=configuration.limits,
        valid_for_s=configuration.sockets.valid_for_s,
        stroke_mm=configuration.geometry.link_length_mm,
        noise=stated_noise(configuration, wires),
        scales_checked=configuration.votes.following_mm is not None,
    )
    return Pipeline(latest, settings, loader)
