"""Duration of the loop's cycle on this computer: the daemon's own loop, run for a moment without gauges."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import NamedTuple

import numpy as np

from compd.compensation import GaugeValues, WarmStart, compensate_cmm
from compd.configuration import Configuration
from compd.errors import Problem
from compd.gauge import good
from compd.link_count import scale_count
from compd.live.loop import Commands, CyclePacker, Directions, Loop, LoopTiming, Setpoint, build_pipeline
from compd.live.machine import LiveModel, MachineWires, MachineZero, ModelLoader, Models, ModelText, try_model
from compd.live.system import THIS_COMPUTER
from compd.model import MachineModel

_CYCLES = 200
# Period (s) of the measured cycles: half a second in all, with other work of the processor in between.
_PERIOD_S = 2.5e-3
# Largest share of the period for a cycle; more leaves too little time for drivers, clients and other programs.
MAX_SHARE = 0.5
_RAW_MM = 10.0
_NOISE_MM = 1e-4
_QUANTITY = 20.0


class CycleTime(NamedTuple):
    """Durations (s) of a cycle, from the snapshot of the readings to the bytes of the setpoint."""

    median_s: float
    longest_s: float


def measure_cycle(configuration: Configuration) -> CycleTime:
    """Run the loop of this configuration for half a second, with readings near machine zero that scatter by 0.1 um.

    The model of `state.model_file` is in it. Raises CompdError if that cannot be used.
    """
    pipeline = build_pipeline(configuration, configuration.gauge_objects())
    latest, wires, settings = pipeline.latest, pipeline.wires, pipeline.settings
    model, zero = first_model(configuration, pipeline.loader), zero_of(configuration, wires)
    try_model(settings.model, (), str(configuration.path))
    commands = Commands(zero, Models(model))
    packer = CyclePacker(Directions(wires.scale.wires))
    numbers = count()
    timing = LoopTiming(min(settings.period_s, _PERIOD_S))

    def keep_on() -> bool:
        """Readings for the next cycle, until the last one."""
        number = next(numbers)
        for channel, slot in latest.index.items():
            value = raw_value(zero, channel) + _NOISE_MM * (number % 3 - 1)
            latest.put(slot, good(value, THIS_COMPUTER.monotonic()))
        return number < _CYCLES

    def send(setpoint: Setpoint) -> None:
        line, _ = setpoint.pack(None)
        packer.pack(setpoint, line)

    Loop(settings, latest, commands, [send], THIS_COMPUTER, timing).run(keep_on)
    return CycleTime(timing.cost.quantile_us(0.5) * 1e-6, timing.cost.largest_us * 1e-6)


def first_model(configuration: Configuration, loader: ModelLoader) -> LiveModel:
    """The model of `state.model_file`, or none. Raises CompdError if that cannot be used."""
    file = configuration.state.model_file
    return loader.load(None if file is None else ModelText.read(Path(file)))


def zero_of(configuration: Configuration, wires: MachineWires) -> MachineZero:
    """A machine zero at which all lengths read the same, and all quantities."""
    readings_mm = dict.fromkeys(wires.length_channels, _RAW_MM)
    return MachineZero(configuration.zero_hash, "", readings_mm, dict.fromkeys(wires.quantity_names, _QUANTITY))


def raw_value(zero: MachineZero, channel: str) -> float:
    """What a channel reads at that machine zero."""
    return zero.readings_mm.get(channel, _QUANTITY)


def python_effect_times(configuration: Configuration) -> dict[str, float]:
    """Time (s) of each effect in plain Python of `state.model_file` per cycle in CMM mode, by the effect's id.

    The effects of the library and formulas are compiled; all of them together take some microseconds. Raises CompdError
    if the model cannot be used.
    """
    file = configuration.state.model_file
    if file is None:
        return {}
    pipeline = build_pipeline(configuration, configuration.gauge_objects())
    model = pipeline.loader.load(ModelText.read(Path(file)))
    without_s = _compensation_time(replace(model.machine, effects=()), model.quantities)
    return {
        fitted.effect.id: _compensation_time(replace(model.machine, effects=(fitted,)), model.quantities) - without_s
        for fitted in model.machine.live_effects
        if callable(fitted.effect.basis)
    }


def _compensation_time(machine: MachineModel, quantities: Sequence[str]) -> float:
    """Median time of a compensation at machine zero, s."""
    values = GaugeValues(
        np.zeros(scale_count(machine.links)),
        np.zeros(machine.joint_weights.shape[1]),
        np.zeros(9),
        dict.fromkeys(quantities, np.array(_QUANTITY)),
        0.0,
        dict.fromkeys(quantities, _QUANTITY),
    )
    warm = WarmStart.at_zero(machine)
    times_s = []
    for _ in range(_CYCLES):
        begin_s = time.perf_counter()
        compensate_cmm(machine, values, warm)
        times_s.append(time.perf_counter() - begin_s)
    return float(np.median(times_s))


def cycle_warnings(configuration: Configuration, cycle: CycleTime) -> list[Problem]:
    """A warning about a rate that leaves the loop no time."""
    rate_hz = configuration.loop.rate_hz
    if cycle.median_s * rate_hz <= MAX_SHARE:
        return []
    fastest_hz = MAX_SHARE / cycle.median_s
    return [
        Problem(
            configuration.where("loop", "rate_hz"),
            f"a cycle takes {cycle.median_s * 1e3:.2f} ms on this computer: cycles would be missed",
            value=f"{rate_hz:g} Hz, a cycle every {1e3 / rate_hz:.2f} ms",
            allowed=f"{fastest_hz:.0f} Hz, so that half of the time is left",
            next_step="lower rate_hz, or take a faster computer",
        )
    ]
