"""Fitting an effect with a nonlinear constant: a time constant, a period, an exponent.

An effect is linear in its parameters only for given nonlinear constants (its shape). Variable projection: for each
value of the constant all parameters are fitted (`fit`), and the loss that is left is a function of the constant
alone. It is evaluated on the effect's grid, and for a period where the residual suggests one
(`compd.comparison.period_search`). One continuous constant is then refined between the neighbours of the best value by
Brent's method.

Source: G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413 (separable least squares).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from compd.arrays import FloatArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.effect_fit import FitResult, fit, initial_effect
from compd.comparison.period_search import neighbouring_periods, promising_constants
from compd.model.effects import ConstantValues, Effect, FittedEffect

# A constant is known well enough when an error of it moves the residual by less than its own standard error: 1 % is.
FINE = 0.01


class _Trial(NamedTuple):
    """A fit with one shape, and its loss in um^2."""

    shape: ConstantValues
    loss: float
    result: FitResult


def search_constants(
    aligned: AlignedRecording,
    model: Sequence[FittedEffect],
    effect: Effect,
    sigma_um: FloatArray,
) -> FitResult:
    """Fit `effect` jointly with the effects of the model, and search its nonlinear constants.

    sigma_um : (m,) standard deviation of each coordinate's noise, as weights of `fit`.
    The loss is the mean squared residual, in which no row counts more than an outlier's limit: which rows are
    outliers differs from fit to fit. The standard errors of the result do not include the search.
    Beside the grid of a period those are tried that the residual suggests; where the machine's description gives the
    period, another one must be evident (`_evident`).

    Raises CompdError as `fit` does.
    """
    links = aligned.rows.links
    shapes = effect.constant_grid(aligned.rows)
    if len(shapes) == 1 and not any(constant.period_of for constant in effect.constants):
        return fit(aligned, [*model, initial_effect(effect, shapes[0], links)], sigma_um)
    without = fit(aligned, model, sigma_um)
    limit_um2 = (aligned.criteria.outlier_sigmas * without.rms_um) ** 2

    def loss_um2(result: FitResult) -> float:
        known = np.isfinite(result.residual_um).all(axis=1)
        return float(np.mean(np.minimum(result.residual_um[known] ** 2, limit_um2)))

    def trial(shape: ConstantValues) -> _Trial:
        result = fit(aligned, [*model, initial_effect(effect, shape, links)], sigma_um)
        return _Trial(shape, loss_um2(result), result)

    best = min((trial(shape) for shape in shapes), key=lambda candidate: candidate.loss)
    promising = promising_constants(effect, aligned, without.residual_um, without.used)
    if promising.constants:
        suggested = min((trial(shape) for shape in promising.constants), key=lambda candidate: candidate.loss)
        if suggested.loss < best.loss and (
            len(shapes) > 1
            or _evident(suggested, best, loss_um2(without), promising.independent, aligned.criteria.periods.chance)
        ):
            best = suggested
            shapes = [*shapes, *promising.constants]
    bracket = _bracket(effect, aligned, best.shape, shapes)
    if bracket is None:
        return best.result
    name, low, high = bracket
    logarithmic = low > 0  # time constants span decades

    def with_constant(x: float) -> ConstantValues:
        return {**best.shape, name: float(np.exp(x)) if logarithmic else x}

    bounds = (np.log(low), np.log(high)) if logarithmic else (low, high)
    refined = minimize_scalar(
        lambda x: trial(with_constant(x)).loss,
        bounds=bounds,
        method="bounded",
        options={"xatol": FINE * min(1.0, bounds[1] - bounds[0]) if logarithmic else FINE * (high - low)},
    )
    if refined.fun < best.loss:
        return trial(with_constant(float(refined.x))).result
    return best.result


def _bracket(
    effect: Effect, aligned: AlignedRecording, shape: ConstantValues, shapes: Sequence[ConstantValues]
) -> tuple[str, float, float] | None:
    """The one continuous constant that was searched, and the values next to its best between which it is refined."""
    continuous = [
        constant
        for constant in effect.constants
        if not constant.choice and len({other[constant.name] for other in shapes}) > 1
    ]
    if len(continuous) != 1:
        return None
    (constant,) = continuous
    if constant.period_of:
        return constant.name, *neighbouring_periods(effect, constant, aligned, shape[constant.name])
    grid = sorted({other[constant.name] for other in shapes})
    index = grid.index(shape[constant.name])
    return constant.name, grid[max(index - 1, 0)], grid[min(index + 1, len(grid) - 1)]


def _evident(suggested: _Trial, described: _Trial, loss_without: float, independent: int, chance: float) -> bool:
    """Whether a period that was searched is more probable than the one of the machine's description, and no chance.

    The gain of n values, n log(loss without / loss), has by noise alone a chi-squared distribution with as many
    degrees of freedom as the effect has parameters (likelihood ratio); a search has as many chances as there are
    independent periods (Bonferroni).
    """
    from scipy.stats import chi2  # takes a third of a second, and is seldom needed

    numbers = float(np.isfinite(suggested.result.residual_um).sum())
    parameters = len(suggested.result.fitted[-1].theta)
    by_search, by_description = (
        float(chi2.logsf(numbers * np.log(loss_without / trial.loss), parameters)) for trial in (suggested, described)
    )
    return bool(np.log(independent) + by_search < min(by_description, np.log(chance)))
