"""Periods of gauges with pushed values, and warnings about too long ones."""

from __future__ import annotations

import math
from typing import Any

from compd.configuration import Configuration
from compd.errors import Problem
from compd.gauge import Gauge
from compd.line_settings import LineSettings, PushedLineSettings
from compd.pushed_gauge import PushedGauge
from compd.source_time import LATE


def longest_period_s(line: LineSettings, gauge: Gauge[Any]) -> float:
    """The longest time from one value of a gauge to the next, s; nan where the configuration does not say it."""
    if isinstance(line, PushedLineSettings) and line.longest_period_s is not None:
        return line.longest_period_s
    period_s = gauge.period_s if isinstance(gauge, PushedGauge) else None
    return math.nan if period_s is None else period_s


def period_warnings(configuration: Configuration) -> list[Problem]:
    """Gauges whose values become stale before the next one."""
    problems = []
    for name, gauge in configuration.gauge_objects().items():
        options = configuration.gauges[name]
        line = configuration.lines[options.line]
        if not isinstance(line, PushedLineSettings):
            continue
        period_s = longest_period_s(line, gauge)
        stale_after_s = options.stale_after_s or configuration.loop.stale_after_s
        if LATE * period_s > stale_after_s:
            problems.append(
                Problem(
                    configuration.where("gauges", name),
                    f"a new value comes every {period_s:g} s: readings go stale between two of them",
                    value=f"{stale_after_s:g} s until stale",
                    allowed=f"{LATE * period_s:.3g} s or more",
                    next_step=f"let the device send more often and lower `{line.period_key}`, or raise `stale_after_s`",
                )
            )
    return problems
