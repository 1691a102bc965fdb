"""Which fitted parameters are plausible, and which the rows determine at all."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.findings import ParameterEstimate
from compd.model.effects import Effect


def estimate_parameters(
    effect: Effect, links: int, theta: FloatArray, covariance: FloatArray, criteria: Criteria
) -> list[ParameterEstimate]:
    """The parameters theta (P,) of an effect in the units that people read, from their covariance (P, P).

    A standard error is nan where the covariance has no row for the parameter.
    """
    estimates = []
    for k, column in enumerate(effect.columns(links)):
        std = float(np.sqrt(covariance[k, k])) if k < len(covariance) else float("nan")
        value, shown_std = column.parameter.from_theta(float(theta[k]), std)
        plausible = is_plausible(column.parameter.theta_range, float(theta[k]), std, criteria)
        low, high = min(column.parameter.low, 0.0), max(column.parameter.high, 0.0)
        estimates.append(ParameterEstimate(column.name, value, shown_std, column.parameter.unit, plausible, low, high))
    return estimates


def is_plausible(limits: tuple[float, float], theta: float, std: float, criteria: Criteria) -> bool:
    """Whether a fitted parameter may be inside its range (low, high), given its standard error.

    It may be outside by `range_sigmas` standard errors, or by `range_slack` of the range. A cause may be weaker than is
    usual: every range reaches to nought. Where it ends there, beyond it is the wrong sign, and only the standard error
    counts. An unknown standard error (nan) excuses nothing.
    """
    margin = criteria.range_sigmas * float(np.nan_to_num(std))
    ((low, high),) = with_slack(np.array([limits]), criteria)
    return bool(min(low, min(limits[0], 0.0) - margin) <= theta <= max(high, max(limits[1], 0.0) + margin))


def with_slack(limits: FloatArray, criteria: Criteria) -> FloatArray:
    """(P, 2) limits that reach to nought, wider by `range_slack`; where they end there, the sign counts."""
    low, high = np.minimum(limits[:, 0], 0.0), np.maximum(limits[:, 1], 0.0)
    slack = criteria.range_slack * (high - low)
    return np.stack([np.where(low < 0, low - slack, low), np.where(high > 0, high + slack, high)], axis=1)


def is_undetermined(limits: FloatArray, std: FloatArray) -> bool:
    """Whether no parameter (P,) of an effect has a standard error below the width of its range (P, 2)."""
    return bool((~(std < limits[:, 1] - limits[:, 0])).all())
