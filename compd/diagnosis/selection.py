"""Whether an explanation is enough: what an effect must gain, what may be left, which parameters are plausible."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.findings import ParameterEstimate
from compd.model.effect import Effect


def penalty(explained: float, criteria: Criteria, factor: float = 1.0) -> float:
    """What an effect must gain, in squares of the noise floor: factor * max(least_gain, form_error * explained).

    explained : mean square that is above the floor in all.  factor : of effects that have to prove more.
    """
    return factor * max(criteria.least_gain, criteria.form_error * explained)


def is_at_floor(loss: float, criteria: Criteria, explained: float = 0.0) -> bool:
    """Whether a loss is so near the floor that nothing worth a name is left.

    explained : mean square that has been explained, of which a share may be left because of its inexact form.
    """
    return loss <= criteria.most_at_floor + criteria.form_error * max(explained, 0.0)


def explained_fraction(before: float, after: float) -> float:
    """phi = (SSE0 - SSE1) / (SSE0 - n sigma^2), from losses in squares of the noise floor; 0 where nothing is above.

    At most 1: the floor is known to some per cent only, so that more than what is above it can be explained::

        explained_fraction(5.0, 2.0)  # 0.75
    """
    return min((before - after) / (before - 1.0), 1.0) if before > 1.0 else 0.0


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
        estimates.append(ParameterEstimate(column.name, value, shown_std, column.parameter.unit, plausible))
    return estimates


def is_plausible(limits: tuple[float, float], theta: float, std: float, criteria: Criteria) -> bool:
    """Whether a fitted parameter may be inside its range (low, high), given its standard error.

    It may be outside by `range_sigmas` standard errors, or by `range_slack` of the range. A range on one side of zero
    gives the sign, too: the slack ends at zero, and beyond it only the standard error counts. An unknown standard error
    (nan) excuses nothing::

        is_plausible((0.5, 200.0), 0.0, 0.1, criteria)  # True: weaker than usual
        is_plausible((0.5, 200.0), -18.0, 0.1, criteria)  # False: the wrong sign
    """
    low, high = limits
    margin = criteria.range_sigmas * float(np.nan_to_num(std))
    slack = criteria.range_slack * (high - low)
    lowest = -margin if 0 <= low <= slack else low - max(margin, slack)
    highest = margin if 0 <= -high <= slack else high + max(margin, slack)
    return bool(lowest <= theta <= highest)


def is_undetermined(limits: FloatArray, std: FloatArray) -> bool:
    """Whether no parameter (P,) of an effect has a standard error below the width of its range (P, 2)."""
    return bool((~(std < limits[:, 1] - limits[:, 0])).all())
