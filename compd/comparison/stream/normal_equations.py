"""Normal equations of weighted least squares, added up over rows and kept apart by cluster."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.comparison.nuisance import MIN_SHARE
from compd.statistics import covariance_of_normals, normal_norms, solve_normal


class Sums(NamedTuple):
    """Of whitened rows g with residuals e and weights w: sum w g g^T (P, P), sum w g e (P,)."""

    normal: FloatArray
    score: FloatArray


class ClusterNormals:
    """Sums by cluster.

    squares : sum w e^2.  values : how many e there are.  rows : as many as there are.
    """

    def __init__(self) -> None:
        self._by_cluster: dict[int, Sums] = {}
        self.squares, self.values, self.rows = 0.0, 0, 0

    def add_rows(self, G: FloatArray, residual: FloatArray, weight: FloatArray, cluster: IntArray) -> None:
        """G : (N, m, P).  residual : (N, m).  weight, cluster : (N,)."""
        m = residual.shape[1]
        for number in np.unique(cluster).tolist():
            rows = cluster == number
            A, w = G[rows].reshape(-1, G.shape[2]), np.repeat(weight[rows], m)
            e = residual[rows].ravel() * w
            self._add(number, Sums(A.T @ (A * w[:, None]), A.T @ e))
        self.squares += float((residual**2).sum(axis=1) @ weight)
        self.values += residual.size
        self.rows += len(residual)

    def add(self, other: ClusterNormals) -> None:
        """The sums of other rows."""
        for number, sums in other._by_cluster.items():
            self._add(number, sums)
        self.squares += other.squares
        self.values += other.values
        self.rows += other.rows

    def _add(self, number: int, sums: Sums) -> None:
        before = self._by_cluster.get(number)
        if before is not None:
            sums = Sums(before.normal + sums.normal, before.score + sums.score)
        self._by_cluster[number] = sums

    @property
    def clusters(self) -> int:
        """How many clusters have rows."""
        return len(self._by_cluster)

    @property
    def total(self) -> Sums:
        """Over all clusters."""
        each = list(self._by_cluster.values())
        normal = np.sum([sums.normal for sums in each], axis=0)
        return Sums(normal, np.sum([sums.score for sums in each], axis=0))

    def step(self, parameters: int) -> tuple[FloatArray, float]:
        """(P + Q,) by how much parameters and nuisance terms move, and by how much that moves the prediction, rms.

        parameters : P, the first columns.
        """
        total = self.total
        basis = _beside(total.normal, parameters)
        normal = basis.T @ total.normal @ basis
        step = solve_normal(normal, basis.T @ total.score)
        return basis @ step, float(np.sqrt(max(float(step @ normal @ step), 0.0) / self.values))

    def covariance(self, parameters: int) -> FloatArray:
        """(P, P) of the first P parameters, as `cluster_covariance` gives it."""
        basis = _beside(self.total.normal, parameters)
        each = list(self._by_cluster.values())
        normal = np.stack([basis.T @ sums.normal @ basis for sums in each])
        score = np.stack([basis.T @ sums.score for sums in each])
        return covariance_of_normals(normal, score, self.squares, self.values)[:parameters, :parameters]


def _beside(normal: FloatArray, parameters: int) -> FloatArray:
    """(P + Q, P + Q') combinations of columns: the parameters', then of the nuisance terms what the parameters' columns
    leave of them, see `compd.comparison.nuisance.nuisance_beside`."""
    P, count = parameters, len(normal)
    if P in (0, count):
        return np.eye(count)
    norms = normal_norms(normal)[P:]
    own, cross = normal[:P, :P], normal[:P, P:] / norms
    left = normal[P:, P:] / np.outer(norms, norms) - cross.T @ solve_normal(own, cross)
    squares, vectors = np.linalg.eigh(left)
    kept = vectors[:, squares > MIN_SHARE**2] / norms[:, None]
    basis = np.zeros((count, P + kept.shape[1]))
    basis[:P, :P] = np.eye(P)
    basis[P:, P:] = kept
    return basis
