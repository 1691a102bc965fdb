"""Stated noise of a gauge and its source: the configuration, else the driver by its device's data sheet."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from compd.gauge import Gauge, GaugeOptions


class StatedNoise(NamedTuple):
    """um : standard deviation of one reading of a length, um; nan if not stated. source : of the statement."""

    um: float
    source: str


# Fluctuation (mm) of a display at rest without stated noise: its last digit.
UNREST_MM = 0.001
# Largest difference of two readings of the same value, in standard deviations of their difference, and of one reading.
DIFFERENCE_SIGMAS = 6.0
SAME_VALUE_SIGMAS = DIFFERENCE_SIGMAS * math.sqrt(2)
# Ratio of scatter and stated noise, either way, that contradicts the statement. A flickering last digit makes up to 1.7
# times its average.
SCATTER_RATIO = 2.0


def tolerance_mm(noise_um: float | None) -> float:
    """Largest difference (mm) of two readings of the same value. noise_um : standard deviation of one, um."""
    return (
        UNREST_MM if noise_um is None or math.isnan(noise_um) else max(UNREST_MM, SAME_VALUE_SIGMAS * noise_um * 1e-3)
    )


NOT_STATED = StatedNoise(math.nan, "")


def stated_noise(options: GaugeOptions, driver: type[Gauge[Any]]) -> StatedNoise:
    """Stated noise of a gauge's lengths; the configuration overrides the data sheet."""
    if options.noise_um is not None:
        return StatedNoise(options.noise_um, "configuration")
    sheet = driver(options).noise
    return NOT_STATED if sheet is None else StatedNoise(sheet.um, f"driver: {sheet.source}")
