"""Faults of a gauge's signal, which its device digitises and sends as if it were right."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass

from tests.injection.faults import Exchange, NumbersFault
from tests.injection.replies import Values


@dataclass
class Scaled(NumbersFault):
    """Channels that show their number times a factor, which grows by `per_s` every second."""

    channels: tuple[str, ...]
    factor: float = 1.0
    per_s: float = 0.0

    def numbers(self, values: Values, exchange: Exchange) -> Mapping[str, float]:
        factor = self.factor + self.per_s * exchange.elapsed_s
        return {name: values[name] * factor for name in self.channels if name in values}


@dataclass
class Steps(NumbersFault):
    """Channels that jump by `by`, `count` times, `every_s` apart: signal periods that are not counted."""

    channels: tuple[str, ...]
    by: float
    every_s: float
    count: int

    def numbers(self, values: Values, exchange: Exchange) -> Mapping[str, float]:
        steps = min(1 + int(exchange.elapsed_s / self.every_s), self.count)
        return {name: values[name] + steps * self.by for name in self.channels if name in values}


@dataclass
class Noisy(NumbersFault):
    """Normal noise of this standard deviation, drawn anew for every reply and channel."""

    channels: tuple[str, ...]
    deviation: float
    seed: int = 0

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def numbers(self, values: Values, exchange: Exchange) -> Mapping[str, float]:
        return {
            name: values[name] + self._random.gauss(0.0, self.deviation) for name in self.channels if name in values
        }


@dataclass
class Hum(NumbersFault):
    """The mains in a signal: a sine, seen at the times of the polls."""

    channels: tuple[str, ...]
    amplitude: float
    hz: float = 50.0

    def numbers(self, values: Values, exchange: Exchange) -> Mapping[str, float]:
        off = self.amplitude * math.sin(2 * math.pi * self.hz * exchange.elapsed_s)
        return {name: values[name] + off for name in self.channels if name in values}


@dataclass
class Coarse(NumbersFault):
    """Channels whose last digit is this large."""

    channels: tuple[str, ...]
    step: float

    def numbers(self, values: Values, exchange: Exchange) -> Mapping[str, float]:
        return {name: round(values[name] / self.step) * self.step for name in self.channels if name in values}
