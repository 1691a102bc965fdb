"""Drift of a parameter over campaigns: a line by weighted least squares, named if it is no chance.

The line is c + b t, weighted with the standard errors of the values. These say how well a recording determines the
parameter, and not what else changes from campaign to campaign. How much that is shows in the scatter about the lines of
all machines: where the median of chi^2 is more than chance makes, all standard errors of the parameter grow by the root
of the ratio. Where one machine still scatters more than the others, its own grow by Birge's ratio
sqrt(chi^2 / (n - 2)), and the chance of its line is that of Student's t with n - 2 degrees of freedom.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import groupby
from statistics import median
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, norm, t

from compd.arrays import FloatArray
from compd.fleet.criteria import FleetCriteria
from compd.fleet.recording_result import RecordingResult

_SECONDS_PER_DAY = 86400.0


@dataclass(frozen=True, eq=False)
class Drift:
    """One parameter of one machine over its C campaigns."""

    machine: str  #: machine, kinematics, effect, parameter, unit: whose values they are
    kinematics: str
    effect: str
    parameter: str
    unit: str
    started_at: tuple[datetime, ...]  #: when each campaign began; empty where one of them does not say
    time: FloatArray  #: (C,) days since the machine's first campaign; without `started_at` their number, from 1
    value: FloatArray  #: value, standard_error: (C,) in `unit`
    standard_error: FloatArray
    #: intercept, slope, slope_std: of the line, in `unit` and `unit` per day (or per campaign); nan where there is none
    intercept: float = math.nan
    slope: float = math.nan
    slope_std: float = math.nan
    #: chance of so steep a line for a parameter that stays the same; nan where there is no line
    p_value: float = math.nan
    named: bool = False  #: whether that is too rare to be chance

    @property
    def name(self) -> str:
        """Name of the parameter: "link_expansion.a"."""
        return f"{self.effect}.{self.parameter}"

    @property
    def change(self) -> float:
        """Change along the line from the first to the last campaign, in `unit`."""
        return self.slope * float(self.time[-1] - self.time[0])

    @property
    def change_std(self) -> float:
        """Standard error of `change`."""
        return self.slope_std * float(self.time[-1] - self.time[0])


class _WeightedLine(NamedTuple):
    """A line through values whose standard errors are taken as they are; chi_squared : of what is left."""

    intercept: float
    slope: float
    slope_std: float
    chi_squared: float
    dof: int


def drifts(results: Iterable[RecordingResult], criteria: FleetCriteria = FleetCriteria()) -> tuple[Drift, ...]:
    """Every parameter of every machine over its campaigns, by machine and name.

    A line is fitted where there are enough campaigns whose standard errors are known.
    """
    series = _series(results)
    lines = [_line(drift, criteria) for drift in series]
    ratios: dict[tuple[str, str], list[float]] = {}
    for drift, line in zip(series, lines, strict=True):
        if line is not None:
            ratios.setdefault((drift.name, drift.unit), []).append(line.chi_squared / chi2.median(line.dof))
    scales = {parameter: max(1.0, math.sqrt(median(of_machines))) for parameter, of_machines in ratios.items()}
    tried = sum(line is not None for line in lines)
    return tuple(
        drift if line is None else _judged(drift, line, scales[drift.name, drift.unit], tried, criteria)
        for drift, line in zip(series, lines, strict=True)
    )


def _series(results: Iterable[RecordingResult]) -> list[Drift]:
    """The values of each parameter of each machine, in the order of its campaigns, without a line."""
    series = []
    examined = sorted((result for result in results if not result.problem), key=lambda result: result.machine)
    for machine, group in groupby(examined, key=lambda result: result.machine):
        campaigns = list(group)
        dated = all(campaign.started_at for campaign in campaigns)
        campaigns.sort(key=lambda campaign: (campaign.started_at if dated else 0, campaign.recording))
        first = campaigns[0].started_at
        points: dict[tuple[str, str, str], list[tuple[float, datetime | None, float, float]]] = {}
        for number, campaign in enumerate(campaigns, start=1):
            began = campaign.started_at if dated else None
            time = (began - first).total_seconds() / _SECONDS_PER_DAY if began and first else float(number)
            for estimate in campaign.estimates:
                key = (estimate.effect, estimate.parameter, estimate.unit)
                points.setdefault(key, []).append((time, began, estimate.value, estimate.standard_error))
        for (effect, parameter, unit), values in sorted(points.items()):
            time, value, standard_error = np.array([(at, v, s) for at, _, v, s in values], dtype=np.float64).T
            began_at = tuple(began for _, began, _, _ in values if began is not None)
            series.append(
                Drift(machine, campaigns[0].kinematics, effect, parameter, unit, began_at, time, value, standard_error)
            )
    return series


def _line(drift: Drift, criteria: FleetCriteria) -> _WeightedLine | None:
    """The line of a parameter; None if none can be fitted."""
    weighable = np.isfinite(drift.value) & np.isfinite(drift.standard_error) & (drift.standard_error > 0)
    time, value, sigma = (column[weighable] for column in (drift.time, drift.value, drift.standard_error))
    if len(time) < criteria.fewest_campaigns or np.ptp(time) == 0:
        return None
    weight = sigma**-2
    middle = np.average(time, weights=weight)
    spread = float(np.sum(weight * (time - middle) ** 2))
    slope = float(np.sum(weight * (time - middle) * value)) / spread
    intercept = float(np.average(value, weights=weight) - slope * middle)
    chi_squared = float(np.sum(weight * (value - intercept - slope * time) ** 2))
    return _WeightedLine(intercept, slope, spread**-0.5, chi_squared, len(time) - 2)


def _judged(drift: Drift, line: _WeightedLine, scale: float, tried: int, criteria: FleetCriteria) -> Drift:
    """The parameter with its line, and whether that is named.

    scale : by which the standard errors of this parameter are too small on all machines.  tried : lines of the fleet.
    """
    slope_std, chi_squared = scale * line.slope_std, line.chi_squared / scale**2
    if chi2.sf(chi_squared, line.dof) < criteria.scatter_p_value:
        slope_std *= math.sqrt(chi_squared / line.dof)
        p_value = float(2 * t.sf(abs(line.slope) / slope_std, line.dof))
    else:
        p_value = float(2 * norm.sf(abs(line.slope) / slope_std))
    return replace(
        drift,
        intercept=line.intercept,
        slope=line.slope,
        slope_std=slope_std,
        p_value=p_value,
        named=p_value * tried < criteria.drift_p_value,
    )


def named_drifts(found: Sequence[Drift]) -> list[Drift]:
    """The named drifts, the surest first."""
    return sorted((drift for drift in found if drift.named), key=lambda drift: drift.p_value)
