"""Robust statistics: standard deviations and a regression that a few per cent of outliers do not move.

The regression is Huber's M-estimate by iteratively reweighted least squares: a row whose residual is up to `huber`
standard deviations counts in full, one beyond it counts less the farther it is. Example, a line through fifty points
of which one is an outlier (G has one row of one coordinate for each)::

    >>> x = np.arange(50.0)
    >>> y = 2.0 * x + 0.1 * (-1.0) ** x
    >>> y[49] += 1000.0  # plain least squares gives a slope of 3.21
    >>> robust_regression(x[:, None, None], y[:, None], huber=2.5).round(3)
    array([2.001])

Source: P. J. Huber, Robust Statistics, Wiley 1981, chapters 5 (scale) and 7 (regression).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from compd.arrays import FloatArray
from compd.statistics.least_squares import column_norms, solve_least_squares, solve_ridge

# Rounds of reweighting: the weights settle in three to five.
ROUNDS = 8
# Residuals are um or standard deviations of the noise: a smaller standard deviation is rounding.
MIN_SIGMA = 1e-9
# Median of |x| and its 95 % point, of a normal distribution with standard deviation 1.
MEDIAN_OF_NORMAL, P95_OF_NORMAL = 0.674490, 1.959964

# Of `trimmed_scale`, in standard deviations: values beyond WINSORIZED count as if they were there, values beyond
# TRIMMED not at all. A larger WINSORIZED uses more of normal noise, a smaller one stands more outliers: with 2 up to
# 23 %, with 1.5 up to 35 %. One value of normal noise in 16 000 is beyond TRIMMED.
WINSORIZED, TRIMMED = 2.0, 4.0
# E[min(z^2, k^2)] of a normal z between -TRIMMED and TRIMMED, k = WINSORIZED.
WINSORIZED_MEAN_SQUARE = 0.920342
# Variance of a standard deviation of normal values over that of `trimmed_scale`: 1 / 2 over E[chi^2] / E[z chi']^2 with
# chi = min(z^2, k^2) - E[min(z^2, k^2)] (Huber, 1981, section 5.2).
SCALE_EFFICIENCY = 0.885


def robust_sigma(values: FloatArray) -> FloatArray:
    """(m,) standard deviation of values (N, m) about zero, not moved by a few per cent of outliers.

    The larger of two estimates: median(|x|) / 0.6745 (the MAD, scaled to a normal distribution) and the 95 % point
    of |x| over 1.96. Where the model lacks an effect that acts on few rows, the MAD alone would make outliers of
    them; and values rounded by a display can have a median of zero.
    """
    size = np.abs(values)
    return np.asarray(
        np.maximum(np.median(size, axis=0) / MEDIAN_OF_NORMAL, np.quantile(size, 0.95, axis=0) / P95_OF_NORMAL)
    )


def trimmed_scale(values: FloatArray, weight: FloatArray | None = None) -> FloatArray:
    """(m,) standard deviation of values (N, m) about zero, from which outliers are trimmed.

    Huber's proposal 2: the s at which the mean of min(|x| / s, WINSORIZED)^2 is what it is for normal noise. What is
    beyond TRIMMED of it is dropped, and s is taken anew, until nothing is dropped. It is unbiased for normal noise, and
    has `SCALE_EFFICIENCY` of the degrees of freedom; for rounded noise it holds the rounding. It is 0 where more than
    77 % of the values are 0.

    weight : (N,) of each value; all alike if None.
    """
    weight = np.ones(len(values)) if weight is None else weight
    return np.array([_trimmed_scale(column**2, weight) for column in values.T])


def _trimmed_scale(squares: FloatArray, weight: FloatArray) -> float:
    """`trimmed_scale` of one coordinate, from its squares (N,)."""
    order = np.argsort(squares, kind="stable")
    squares, weight = squares[order], weight[order]
    while True:
        variance = _proposal_2(squares, weight)
        kept = int(np.searchsorted(squares, TRIMMED**2 * variance, side="right"))
        if kept == len(squares) or variance == 0.0:
            return float(np.sqrt(variance))
        squares, weight = squares[:kept], weight[:kept]


def _proposal_2(squares: FloatArray, weight: FloatArray) -> float:
    """The variance s^2 with sum w min(x^2 / s^2, k^2) = beta sum w, of sorted squares x^2 (N,); k = WINSORIZED.

    If the first j squares are below k^2 s^2 and the others are not, s^2 = sum_{i <= j} w x^2 / (beta W - k^2 W_j), W_j
    being the weight of the others: s^2 belongs to the first j that agrees with itself.
    """
    total = weight.sum()
    room = WINSORIZED_MEAN_SQUARE * total - WINSORIZED**2 * (total - np.cumsum(weight))
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.where(room > 0, np.cumsum(weight * squares) / room, np.inf)
    agrees = WINSORIZED**2 * variance <= np.append(squares[1:], np.inf)
    return float(variance[np.argmax(agrees)])


def huber_weights(
    residual: FloatArray,
    exponent: float = 1.0,
    scale: Callable[[FloatArray], FloatArray] = robust_sigma,
    *,
    huber: float,
) -> FloatArray:
    """(N,) weight of each row of a residual (N, m) by its worst coordinate.

    huber : Huber's constant, in standard deviations.
    With u_i = max_j |r_ij| / sigma_j, sigma by `scale`: w_i = min(1, huber / u_i)^exponent. Exponent 1 is Huber's
    weight, where an outlier keeps a bounded pull; with 2 its pull falls as 1 / u.
    """
    size = (np.abs(residual) / np.maximum(scale(residual), MIN_SIGMA)).max(axis=1)
    return np.asarray(np.minimum(1.0, huber / np.maximum(size, huber)) ** exponent)


def robust_regression(
    G: FloatArray,
    y: FloatArray,
    *,
    ridge: float | None = None,
    exponent: float = 1.0,
    rounds: int = ROUNDS,
    scale: Callable[[FloatArray], FloatArray] = robust_sigma,
    huber: float,
) -> FloatArray:
    """(P,) parameters theta of y = G theta, by iteratively reweighted least squares.

    G : (N, m, P) columns.  y : (N, m), all coordinates with the same standard deviation.
    ridge : None solves with a rank cut. A number holds every parameter near 0 by this share of its column's squared
    norm: for more columns than the rows may determine.
    exponent, scale, huber : of `huber_weights`.  rounds : of reweighting. `robust_sigma` stands 5 % of outliers and
    takes no few rows for outliers on which an effect acts; `trimmed_scale` stands 23 %.
    """
    N, m, P = G.shape
    A, flat = G.reshape(N * m, P), y.ravel()
    norms = np.ones(P) if ridge is None else column_norms(A)
    A = A / norms
    theta = np.zeros(P)
    weights = np.ones(N)
    for _ in range(rounds):
        row_weights = np.repeat(weights, m)
        if ridge is None:
            theta = solve_least_squares(A, flat, row_weights)
        else:
            weighted = A * row_weights[:, None]
            theta = solve_ridge(weighted.T @ A, weighted.T @ flat, np.full(P, ridge))
        weights = huber_weights((flat - A @ theta).reshape(N, m), exponent, scale, huber=huber)
    return np.asarray(theta / norms)
