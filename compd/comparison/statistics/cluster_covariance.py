"""Standard errors that hold where residuals of neighbouring rows are correlated: the cluster-robust covariance.

Least squares with whitened rows g_i (of the matrix G) and residuals e_i has the covariance of independent errors
V0 = s^2 (G^T G)^-1. Errors that drift are alike in neighbouring rows, and V0 is then too small. The sandwich lets rows
of one block (cluster) c be correlated in any way and takes only blocks as independent:

    V = a (G^T G)^-1 [ sum_c u_c u_c^T ] (G^T G)^-1,    u_c = sum_{i in c} g_i e_i,
    a = C / (C - 1) * (n - 1) / (n - P)

with C blocks, n measured values and P parameters (a is the usual small-sample factor). Blocks of one row each give
the estimate of White. Few blocks make V noisy, and it can come out below V0 by chance; therefore the standard errors
used here are the larger of both, with the correlations of V0.

Sources: H. White, Econometrica 48 (1980) 817; K.-Y. Liang, S. L. Zeger, Biometrika 73 (1986) 13;
A. C. Cameron, D. L. Miller, Journal of Human Resources 50 (2015) 317.
"""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.comparison.statistics.least_squares import determined, normal_inverse


def cluster_covariance(G: FloatArray, residual: FloatArray, block: IntArray) -> FloatArray:
    """(P, P) covariance of the parameters; rows and columns of nan for those that the data do not determine.

    G : (N, m, P) columns, whitened (divided by the standard deviation of the noise).
    residual : (N, m), whitened alike.  block : (N,) number of each row's block.

    Example: a constant, measured in four blocks of which each has its own offset; its standard error is that of the
    mean of four offsets, not that of forty rows::

        >>> offset = np.repeat([1.0, -1.0, 2.0, -2.0], 10)
        >>> G = np.ones((40, 1, 1))
        >>> cluster_covariance(G, offset[:, None], np.repeat(np.arange(4), 10))  # (1 + 1 + 4 + 4) / 4 / 3
        array([[0.83333333]])
    """
    N, m, P = G.shape
    if not P:
        return np.zeros((0, 0))
    A = G.reshape(-1, P)
    n = len(A)
    inverse = normal_inverse(A)
    independent = inverse * (float((residual**2).sum()) / (n - P))
    row_scores = (A * residual.reshape(-1, 1)).reshape(N, m, P).sum(axis=1)
    scores = np.stack([np.bincount(block, column) for column in row_scores.T], axis=1)
    clusters = len(np.unique(block))
    small_sample = clusters / max(clusters - 1, 1) * (n - 1) / (n - P)
    clustered = inverse @ (scores.T @ scores) @ inverse * small_sample

    independent_std = np.sqrt(np.diag(independent))
    std = np.sqrt(np.maximum(np.diag(clustered), np.diag(independent)))
    independent_std[independent_std == 0] = 1.0
    covariance = independent / np.outer(independent_std, independent_std) * np.outer(std, std)
    unknown = ~determined(A)
    covariance[unknown] = np.nan
    covariance[:, unknown] = np.nan
    return np.asarray(covariance)


def cluster_std(x: FloatArray, residual: FloatArray, block: IntArray, dof: int) -> float:
    """Standard error of b in y = b x, the larger of the independent and the clustered one (see above; a = C / (C - 1)).

    x, residual : (R,).  block : (R,).  dof : degrees of freedom of the residual.
    """
    squares = float(x @ x)
    scores = np.bincount(block, x * residual)
    clusters = len(np.unique(block))
    independent = float(residual @ residual) / dof / squares
    clustered = float(scores @ scores) / squares**2 * clusters / max(clusters - 1, 1)
    return float(np.sqrt(max(independent, clustered)))
