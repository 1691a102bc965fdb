"""How much a gauge scatters, and who says so: the configuration, else the driver by its device's data sheet."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from compd.gauge import Gauge, GaugeOptions


class StatedNoise(NamedTuple):
    """um : standard deviation of one reading of a length, um; nan where nobody says. source : who says so."""

    um: float
    source: str


# Last digit of a display that stands still, mm, where no noise is stated.
UNREST_MM = 0.001
# Two readings of the same value differ by less than this many standard deviations of their difference, and of one.
DIFFERENCE_SIGMAS = 6.0
SAME_VALUE_SIGMAS = DIFFERENCE_SIGMAS * math.sqrt(2)
# A scatter that differs from the stated noise by this factor either way is another one. A last digit that goes to and
# fro makes 1.7 times what it makes on average.
SCATTER_RATIO = 2.0


def tolerance_mm(noise_um: float | None) -> float:
    """By how much two readings of the same value may differ, mm. noise_um : standard deviation of one, um."""
    return (
        UNREST_MM if noise_um is None or math.isnan(noise_um) else max(UNREST_MM, SAME_VALUE_SIGMAS * noise_um * 1e-3)
    )


NOT_STATED = StatedNoise(math.nan, "")


def stated_noise(options: GaugeOptions, driver: type[Gauge[Any]]) -> StatedNoise:
    """Of the lengths of a gauge; what the configuration says overrides the data sheet."""
    if options.noise_um is not None:
        return StatedNoise(options.noise_um, "configuration")
    sheet = driver(options).noise
    return NOT_STATED if sheet is None else StatedNoise(sheet.um, f"driver: {sheet.source}")
