"""Standard errors that hold where residuals of neighbouring rows are correlated: the cluster jackknife.

Least squares with whitened rows g_i (of the matrix G) and residuals e_i has the covariance of independent errors
V0 = s^2 (G^T G)^-1. Errors that drift are alike in neighbouring rows, and V0 is then too small. The jackknife lets rows
of one block (cluster) c be correlated in any way and takes only blocks as independent: how far the parameters move when
one block is left out says how far chance moves them,

    V = (C - 1) / C sum_c d_c d_c^T,    d_c = theta - theta_(c) = (G^T G - G_c^T G_c)^-1 G_c^T e_c

with C blocks (CR3). The sandwich with the residuals as they are would be too small, because a block pulls the fit to
itself: of 24 blocks with drifting errors, 92 % of its intervals hold the truth, not 95 %. Of few blocks V is itself
uncertain, and the error follows Student's t with C - 1 degrees of freedom: the standard errors from V are enlarged by
the ratio of its 95 % interval to the normal one, so that 1.96 of them, as of any standard error, are that interval.
V can come out below V0 by chance; therefore the standard errors used here are the larger of both, with the
correlations of V0. A parameter that is determined in one block alone has no other than that of V0.

Sources: R. M. Bell, D. F. McCaffrey, Survey Methodology 28 (2002) 169 (CR3, Student's t); A. C. Cameron, D. L. Miller,
Journal of Human Resources 50 (2015) 317 (C - 1 degrees of freedom); J. G. MacKinnon, M. O. Nielsen, M. D. Webb, Journal
of Econometrics 232 (2023) 272 (computation block by block).
"""

from __future__ import annotations

import numpy as np
from scipy.special import fdtri

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.statistics.least_squares import (
    RANK_CUT,
    column_norms,
    determined,
    determined_by_normal,
    normal_inverse,
    normal_norms,
)
from compd.statistics.robust import P95_OF_NORMAL


def cluster_covariance(G: FloatArray, residual: FloatArray, block: IntArray) -> FloatArray:
    """(P, P) covariance of the parameters; rows and columns of nan for those that the data do not determine.

    G : (N, m, P) columns, whitened (divided by the standard deviation of the noise), and multiplied by the root of each
    row's weight where the fit has weights.  residual : (N, m), alike.  block : (N,) number of each row's block.

    Example: a constant, measured in four blocks of which each has its own offset; its standard error is that of the
    mean of four offsets, not that of forty rows, times 1.62 by Student's t with 3 degrees of freedom::

        >>> offset = np.repeat([1.0, -1.0, 2.0, -2.0], 10)
        >>> G = np.ones((40, 1, 1))
        >>> covariance = cluster_covariance(G, offset[:, None], np.repeat(np.arange(4), 10))
        >>> covariance.round(2)  # (1 + 1 + 4 + 4) / 4 / 3 * (3.182 / 1.96)^2
        array([[2.2]])
    """
    m, P = G.shape[1:]
    if not P:
        return np.zeros((0, 0))
    A, e = G.reshape(-1, P), residual.ravel()
    independent = normal_inverse(A) * (float(e @ e) / (len(A) - P))
    return _covariance(independent, _moved_without_each_block(A, e, np.repeat(block, m)), determined(A))


def covariance_of_normals(normal: FloatArray, score: FloatArray, squares: float, values: int) -> FloatArray:
    """As `cluster_covariance`, from sums over the rows of each block.

    normal : (C, P, P) G_c^T G_c.  score : (C, P) G_c^T e_c.  squares : sum of e^2.  values : how many numbers e has.
    """
    P = normal.shape[1]
    if not P:
        return np.zeros((0, 0))
    whole = normal.sum(axis=0)
    norms = normal_norms(whole)
    scales = np.outer(norms, norms)
    independent = np.linalg.pinv(whole / scales, rcond=RANK_CUT**2, hermitian=True) / scales * squares / (values - P)
    without = np.linalg.pinv((whole - normal) / scales, rcond=RANK_CUT**2, hermitian=True)
    moved = (without @ (score / norms)[:, :, None])[:, :, 0] / norms
    return _covariance(independent, moved, determined_by_normal(whole))


def _covariance(independent: FloatArray, moved: FloatArray, known: BoolArray) -> FloatArray:
    """The larger of both variances, with the correlations of independent errors.

    independent : (P, P).  moved : (C, P) as of `_moved_without_each_block`.  known : (P,) determined parameters.
    """
    clusters = len(moved)
    variance = (moved**2).sum(axis=0) * (clusters - 1) / clusters * _by_student(clusters)

    independent_std = np.sqrt(np.diag(independent))
    std = np.sqrt(np.maximum(variance, np.diag(independent)))
    independent_std[independent_std == 0] = 1.0
    covariance = independent / np.outer(independent_std, independent_std) * np.outer(std, std)
    covariance[~known] = np.nan
    covariance[:, ~known] = np.nan
    return np.asarray(covariance)


def _moved_without_each_block(A: FloatArray, e: FloatArray, block: IntArray) -> FloatArray:
    """(C, P) by how much the parameters of A (n, P) move when one block's rows are left out; e : (n,) residual."""
    norms = column_norms(A)
    order = np.argsort(block, kind="stable")
    ends = np.flatnonzero(np.diff(block[order])) + 1
    scaled, left = np.split(A[order] / norms, ends), np.split(e[order], ends)
    normal = np.stack([rows.T @ rows for rows in scaled])
    score = np.stack([rows.T @ values for rows, values in zip(scaled, left, strict=True)])
    inverse = np.linalg.pinv(normal.sum(axis=0) - normal, rcond=RANK_CUT**2, hermitian=True)
    return np.asarray((inverse @ score[:, :, None])[:, :, 0] / norms)


def _by_student(clusters: int) -> float:
    """Square of the 95 % limit of Student's t with clusters - 1 degrees of freedom, over that of the normal one.

    The square of t has the F distribution with 1 and as many degrees of freedom.
    """
    return float(fdtri(1, max(clusters - 1, 1), 0.95)) / P95_OF_NORMAL**2


def cluster_std(x: FloatArray, residual: FloatArray, block: IntArray, dof: int) -> float:
    """Standard error of b in y = b x, the larger of the independent one and the sandwich's, for a test by Student's t.

    With u_c = sum_{i in c} x_i e_i the sandwich is C / (C - 1) sum_c u_c^2 / (sum_i x_i^2)^2 (K.-Y. Liang, S. L. Zeger,
    Biometrika 73 (1986) 13): of one number that hundreds of rows determine, no block pulls the fit to itself.

    x, residual : (R,).  block : (R,).  dof : degrees of freedom of the residual.
    """
    squares = float(x @ x)
    scores = np.bincount(block, x * residual)
    clusters = len(np.unique(block))
    independent = float(residual @ residual) / dof / squares
    clustered = float(scores @ scores) / squares**2 * clusters / max(clusters - 1, 1)
    return float(np.sqrt(max(independent, clustered)))
