"""A configured machine whose thermometers are polled in the test's time, with an effect that reads them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from compd.gauge import Channel, Gauge, GaugeOptions, Reading, good
from compd.live.acquisition.polled_gauge import PolledGauge
from compd.live.machine import Models
from compd.live.wired_trust import wired_channels, wired_memory, wired_trust
from tests.support.live_machine import PERIOD_S, RAW_AT_ZERO_MM, Machine, machine
from tests.support.live_models import file_with

GAUGE = "cabinet"
POLL_S = 0.02
HOLD_S = 1.0
STALE_S = 0.5
NOISE_K = 0.01
PPM_PER_K = 11.5
SEED = 7


class Cabinet(Gauge[Any]):
    """The gauge with the machine's thermometers. shows : what each shows at a time, by its channel."""

    def __init__(self, channels: Sequence[Channel], now_s: Callable[[], float], degC: float) -> None:
        super().__init__(GaugeOptions(driver="test", line=GAUGE))
        self._channels, self._now_s, self._random = channels, now_s, np.random.default_rng(SEED)
        self.shows: dict[str, Callable[[float], float]] = {}
        self.damage: dict[str, list[float]] = {}
        self.noise_K: dict[str, float] = {}
        for channel in channels:
            self.shows[channel.name] = lambda _: degC

    @property
    def channels(self) -> Sequence[Channel]:
        return self._channels

    def read(self, line: object) -> Sequence[Reading]:
        return [self._reading(channel) for channel in self._channels]

    def _reading(self, channel: Channel) -> Reading:
        now_s, name = self._now_s(), channel.name
        if channel.unit != "degC":
            return good(RAW_AT_ZERO_MM, now_s)
        noise_K = self.noise_K.get(name, NOISE_K) * self._random.standard_normal()
        wrong = self.damage[name].pop(0) if self.damage.get(name) else 0.0
        return good(round(self.shows[name](now_s) + noise_K + wrong, 2), now_s)


class WarmMachine(Machine):
    """Its links grow by 11.5 ppm/K, as the model says; nothing else is wrong with it."""

    def __init__(self, live: Machine, path: Path, degC: float, fitted_range: Any = None) -> None:
        super().__init__(live.configuration)
        configuration = self.configuration
        links = configuration.geometry.links
        file = file_with(
            path / "thermal.yaml",
            "link_expansion",
            name=configuration.machine,
            links=links,
            fitted_range=fitted_range,
            link_expansion=PPM_PER_K,
        )
        self.commands.models = Models(self.loader.read(file))
        self.cabinet = Cabinet(configuration.gauge_objects()[GAUGE].channels, lambda: self.now_s, degC)
        self.memory = wired_memory(configuration, self.wires)
        self.wired = wired_channels(configuration, self.wires, self.model)
        self.start_acquisition()
        own = [channel for channel in self.latest.channels if channel.startswith(f"{GAUGE}.")]
        self.frozen = set(own)  # `poll` puts their readings

    def start_acquisition(self) -> None:
        """As a new process would."""
        trust = wired_trust(self.configuration, self.wires, self.memory)
        self.polled = PolledGauge(GAUGE, self.cabinet, self.latest, 0.1, STALE_S, self, trust)

    def monotonic(self) -> float:
        return self.now_s

    def step(self, ending: str = "") -> Any:
        """One poll of the thermometers, and the last cycle before the next one."""
        self.polled.put(self.polled.read(None), self.now_s)
        self.now_s += POLL_S - PERIOD_S
        return super().step(ending)

    def run(self, seconds: float) -> list[Any]:
        """The setpoints of so many seconds."""
        end_s = self.now_s + seconds
        setpoints = []
        while self.now_s < end_s:
            setpoints.append(self.step())
        return setpoints


def warm_machine(name: str, path: Path, degC: float = 23.0, fitted_range: Any = None, **quantity: Any) -> WarmMachine:
    """quantity : keys of every wired quantity. fitted_range : of the model file."""
    live = machine(name)
    loop = live.configuration.loop.model_copy(update={"hold_s": HOLD_S})
    wires = tuple(wire.model_copy(update=quantity) for wire in live.configuration.wiring.quantities)
    wiring = live.configuration.wiring.model_copy(update={"quantities": wires})
    return WarmMachine(Machine(replace(live.configuration, wiring=wiring, loop=loop)), path, degC, fitted_range)
