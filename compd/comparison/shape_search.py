"""Fitting an effect with a nonlinear constant: a time constant, a period, an exponent.

An effect is linear in its parameters only for given nonlinear constants (its shape). Variable projection: for each
value of the constant all parameters are fitted (`fit`), and the loss that is left is a function of the constant
alone. It is evaluated on the effect's grid, and one continuous constant is then refined between the neighbours of
the best grid point by Brent's method.

Source: G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413 (separable least squares).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from compd.arrays import FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.fit import FitResult, fit, initial_effect
from compd.model.effect import ConstantValues, Effect, FittedEffect

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
    criteria: ComparisonCriteria = ComparisonCriteria(),
) -> FitResult:
    """Fit `effect` jointly with the effects of the model, and search its nonlinear constants.

    sigma_um : (m,) standard deviation of each coordinate's noise, as weights of `fit`.
    The loss is the mean squared residual, in which no row counts more than an outlier's limit: which rows are
    outliers differs from fit to fit. The standard errors of the result do not include the search.

    Raises CompdError as `fit` does.
    """
    links = aligned.rows.links
    shapes = effect.constant_grid(aligned.rows)
    if len(shapes) == 1:
        return fit(aligned, [*model, initial_effect(effect, shapes[0], links)], sigma_um, criteria)
    limit_um2 = (criteria.outlier_sigmas * fit(aligned, model, sigma_um, criteria).rms_um) ** 2

    def trial(shape: ConstantValues) -> _Trial:
        result = fit(aligned, [*model, initial_effect(effect, shape, links)], sigma_um, criteria)
        known = np.isfinite(result.residual_um).all(axis=1)
        return _Trial(shape, float(np.mean(np.minimum(result.residual_um[known] ** 2, limit_um2))), result)

    best = min((trial(shape) for shape in shapes), key=lambda candidate: candidate.loss)
    continuous = [
        constant.name
        for constant in effect.constants
        if not constant.choice and len({shape[constant.name] for shape in shapes}) > 1
    ]
    if len(continuous) != 1:
        return best.result
    (name,) = continuous
    grid = sorted({shape[name] for shape in shapes})
    place = grid.index(best.shape[name])
    low, high = grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)]
    logarithmic = low > 0  # time constants and periods span decades

    def with_constant(x: float) -> ConstantValues:
        return {**best.shape, name: float(np.exp(x)) if logarithmic else x}

    refined = minimize_scalar(
        lambda x: trial(with_constant(x)).loss,
        bounds=(np.log(low), np.log(high)) if logarithmic else (low, high),
        method="bounded",
        options={"xatol": FINE if logarithmic else FINE * (high - low)},
    )
    if refined.fun < best.loss:
        return trial(with_constant(float(refined.x))).result
    return best.result
