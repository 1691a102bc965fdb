"""A diagnosis laid out: which rows count, what is left to explain there, and every candidate's columns on them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.compare import Comparison
from compd.comparison.fit import blocks_of
from compd.diagnosis.candidates import Candidate, Pool
from compd.diagnosis.cross_validation import schemes
from compd.diagnosis.outlier_screening import outliers
from compd.diagnosis.regression import Block, Evidence
from compd.diagnosis.subset_search import Contest, Members
from compd.diagnosis.whitening import Whitening
from compd.model.effect import FittedEffect
from compd.units import UM_PER_MM


class DiagnosisProblem:
    """The residual of one comparison in standard deviations of the noise, with the library's candidates.

    outlier : (N,) rows beyond all noise, kept out.  rows : (N,) those that count.
    evidence, values : what the candidates are judged on, and each one's columns there.
    """

    def __init__(self, before: Comparison, pool: Pool, outlier: BoolArray | None = None) -> None:
        """outlier : None to find them beside everything that could explain a row."""
        aligned = before.aligned
        self.before, self.aligned, self.pool = before, aligned, pool
        self.sigma_um = before.floor.by_axis_um
        always = _always_um(before) / self.sigma_um[:, None]
        known: BoolArray = np.asarray(np.isfinite(before.residual_um).all(axis=1))
        known = known & np.isfinite(always).all(axis=(1, 2))
        for one in pool.candidates:
            known = known & np.isfinite(one.columns_um).all(axis=(1, 2))
        self._known, self._always = known, always
        self._y = np.where(known[:, None], before.residual_um, 0.0) / self.sigma_um
        if outlier is None:
            outlier = outliers(self._y, [always, *self._everything()], known, aligned.recording.visit)
        self.outlier = outlier
        self.rows = known & ~outlier
        self.whiten = Whitening(aligned, self.rows, self.sigma_um)
        self.evidence = Evidence(
            self._y[self.rows],
            tuple(_numbered(scheme[self.rows]) for scheme in schemes(aligned)),
            _numbered(blocks_of(aligned.recording)[self.rows]),
            Block(always[self.rows], np.full(always.shape[2], np.inf)),
        )
        self.values = [self.whiten(one.columns_um) for one in pool.candidates]

    def outliers_beside(self, members: Members, contest: Contest) -> BoolArray:
        """(N,) gross rows beside a set of candidates alone."""
        chosen = [contest.candidates[k].columns_um / self.sigma_um[:, None] for k in members]
        return outliers(self._y, [self._always, *chosen], self._known, self.aligned.recording.visit)

    def _everything(self) -> list[FloatArray]:
        """One variant of each effect; time and every measured quantity, along each coordinate."""
        first: dict[str, Candidate] = {}
        for one in self.pool.candidates:
            first.setdefault(one.name, one)
        columns = [one.columns_um / self.sigma_um[:, None] for one in first.values()]
        time_s = self.aligned.rows.time_s
        for values in (time_s, time_s**2, *self.aligned.recording.quantities.values()):
            column = values[self._known]
            if len(column) and np.isfinite(column).all() and np.ptp(column) > 0:
                middle = np.nan_to_num(values - column.mean()) / np.ptp(column)
                columns.append(middle[:, None, None] * np.eye(len(self.aligned.labels)))
        return columns


def _always_um(before: Comparison) -> FloatArray:
    """(N, m, Q) columns of the model's own numbers and of the instrument's frame."""
    aligned = before.aligned
    own: Sequence[FittedEffect] = before.fitted
    columns = [aligned.columns(one.effect, one.constants) * UM_PER_MM for one in own]
    return np.concatenate([*columns, aligned.free_columns * UM_PER_MM], axis=2)


def _numbered(values: IntArray) -> IntArray:
    return np.asarray(np.unique(values, return_inverse=True)[1], dtype=np.int64)
