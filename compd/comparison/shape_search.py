"""Fitting an effect with what it is not linear in: a time constant, a period, an exponent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from compd.arrays import FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.fit import FitResult, fit, start
from compd.comparison.noise_floor import OUTLIER_SIGMAS
from compd.model.effect import ConstantValues, Effect, FittedEffect

# A searched constant is known well enough when it moves the error by less than its own standard error: 1 % is.
FINE = 0.01


def search_constants(
    aligned: AlignedRecording, model: Sequence[FittedEffect], effect: Effect, sigma_um: FloatArray
) -> FitResult:
    """Fit `effect` jointly with the model: every shape on its grid, then between the best and its neighbours.

    sigma_um : (m,) weights.  The standard errors do not know of the search.
    Raises CompdError as `fit` does.
    """
    links = aligned.rows.links
    shapes = effect.constant_grid(aligned.rows)
    if len(shapes) == 1:
        return fit(aligned, [*model, start(effect, shapes[0], links)], sigma_um)
    without = fit(aligned, model, sigma_um)
    limit = (OUTLIER_SIGMAS * without.rms_um) ** 2

    def tried(shape: ConstantValues) -> tuple[float, FitResult]:
        found = fit(aligned, [*model, start(effect, shape, links)], sigma_um)
        known = np.isfinite(found.residual_um).all(axis=1)
        # gross rows count as much as a gross row can, whichever each fit calls so
        return float(np.mean(np.minimum(found.residual_um[known] ** 2, limit))), found

    results = [tried(shape) for shape in shapes]
    best = min(range(len(shapes)), key=lambda k: results[k][0])
    loss, found = results[best]
    searched = [one for one in effect.constants if not one.choice and len({shape[one.name] for shape in shapes}) > 1]
    if len(searched) != 1:
        return found
    name = searched[0].name
    grid = sorted({shape[name] for shape in shapes})
    place = grid.index(shapes[best][name])
    low, high = grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)]
    logarithmic = low > 0

    def value(x: float) -> float:
        return float(np.exp(x)) if logarithmic else x

    ends = (np.log(low), np.log(high)) if logarithmic else (low, high)
    refined = minimize_scalar(
        lambda x: tried({**shapes[best], name: value(x)})[0],
        bounds=ends,
        method="bounded",
        options={"xatol": FINE if logarithmic else FINE * (high - low)},
    )
    if refined.fun < loss:
        found = tried({**shapes[best], name: value(float(refined.x))})[1]
    return found
