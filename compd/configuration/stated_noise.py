"""How much a gauge scatters, and who says so: the configuration, else the driver by its device's data sheet."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from compd.gauge import Gauge, GaugeOptions


class StatedNoise(NamedTuple):
    """um : standard deviation of one reading of a length, um; nan where nobody says. source : who says so."""

    um: float
    source: str


NOT_STATED = StatedNoise(math.nan, "")


def stated_noise(options: GaugeOptions, driver: type[Gauge[Any]]) -> StatedNoise:
    """Of the lengths of a gauge; what the configuration says overrides the data sheet."""
    if options.noise_um is not None:
        return StatedNoise(options.noise_um, "configuration")
    sheet = driver(options).noise
    return NOT_STATED if sheet is None else StatedNoise(sheet.um, f"driver: {sheet.source}")
