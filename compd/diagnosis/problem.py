"""What a diagnosis has to explain: the whitened residual on the rows that count, and each candidate's columns there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.cluster_covariance import neighbour_blocks
from compd.comparison.compare import Comparison
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.outliers import outlier_rows
from compd.comparison.robust import robust_regression
from compd.diagnosis.candidates import Candidate, CandidatePool
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.cross_validation import row_splits
from compd.diagnosis.regression import RegressionData, Regressors
from compd.units import UM_PER_MM

# Ridge of the robust fit beside everything, as a share of each column's squared norm: there may be more columns than
# rows determine.
SCREENING_RIDGE = 1e-4
# A larger exponent of Huber's weight than 1 and more rounds: all columns at once can follow outliers.
SCREENING_EXPONENT = 2.0
SCREENING_ROUNDS = 12


@dataclass(frozen=True, eq=False)
class DiagnosisProblem:
    """The residual of one comparison in standard deviations of the noise, with the candidates for it.

    N rows of the recording, R of which count; m coordinates.

    comparison : of the recording with the model as it is.  pool : the candidates.  criteria : thresholds.
    known : (N,) rows in which the residual and all candidates are known.
    outlier : (N,) rows that no candidate explains; rows : (N,) those that count: known and no outliers.
    residual : (N, m) whitened, 0 where not known.  nuisance : (N, m, Q) whitened columns of what every fit contains.
    data : residual and nuisance columns on the rows that count, and how these are divided.
    values : (R, m, P) whitened columns of each candidate, on the rows that count.
    """

    comparison: Comparison
    pool: CandidatePool
    criteria: Criteria
    known: BoolArray
    outlier: BoolArray
    rows: BoolArray
    residual: FloatArray
    nuisance: FloatArray
    data: RegressionData
    values: tuple[FloatArray, ...]

    @property
    def aligned(self) -> AlignedRecording:
        """The recording."""
        return self.comparison.aligned

    @property
    def sigma_um(self) -> FloatArray:
        """(m,) standard deviation of the noise of each coordinate."""
        return self.comparison.floor.by_axis_um

    def whiten(self, columns_um: FloatArray) -> FloatArray:
        """(R, m, P) columns (N, m, P) in um, in standard deviations of the noise on the rows that count."""
        return np.asarray(columns_um[self.rows] / self.sigma_um[:, None])


def build_problem(
    comparison: Comparison, pool: CandidatePool, criteria: Criteria, outlier: BoolArray | None = None
) -> DiagnosisProblem:
    """Whiten the residual and the candidates of a comparison.

    outlier : (N,) rows to leave out; None to screen for them beside everything that could explain a row. What a
        candidate could explain does not make a row an outlier then, and hides no outlier either: behind an effect of
        six times the noise an error of twenty times would be hidden.
    """
    aligned, sigma_um = comparison.aligned, comparison.floor.by_axis_um
    nuisance = _nuisance_um(comparison) / sigma_um[:, None]
    known: BoolArray = np.asarray(np.isfinite(comparison.residual_um).all(axis=1))
    for columns in (nuisance, *(candidate.columns_um for candidate in pool.candidates)):
        known &= np.isfinite(columns).all(axis=(1, 2))
    residual = np.where(known[:, None], comparison.residual_um, 0.0) / sigma_um
    if outlier is None:
        everything = [nuisance, *_everything(aligned, pool, sigma_um, known)]
        outlier = _outliers_beside(everything, residual, known, aligned.recording.visit, criteria.comparison)
    rows = known & ~outlier
    data = RegressionData(
        residual[rows],
        tuple(_renumbered(fold[rows]) for fold in row_splits(aligned, criteria)),
        _renumbered(neighbour_blocks(aligned.recording)[rows]),
        Regressors(nuisance[rows], np.full(nuisance.shape[2], np.inf)),
    )
    values = tuple(candidate.columns_um[rows] / sigma_um[:, None] for candidate in pool.candidates)
    return DiagnosisProblem(comparison, pool, criteria, known, outlier, rows, residual, nuisance, data, values)


def screen_outliers(problem: DiagnosisProblem, candidates: Sequence[Candidate]) -> BoolArray:
    """(N,) outliers beside some candidates alone."""
    columns = [candidate.columns_um / problem.sigma_um[:, None] for candidate in candidates]
    visit = problem.aligned.recording.visit
    criteria = problem.criteria.comparison
    return _outliers_beside([problem.nuisance, *columns], problem.residual, problem.known, visit, criteria)


def _outliers_beside(
    columns: Sequence[FloatArray],
    residual: FloatArray,
    known: BoolArray,
    visit: IntArray | None,
    criteria: ComparisonCriteria,
) -> BoolArray:
    """(N,) outliers of what a robust fit of all columns (N, m, P) at once and a constant leaves of residual (N, m)."""
    constant = np.broadcast_to(np.eye(residual.shape[1]), (*residual.shape, residual.shape[1]))
    G = np.concatenate([constant, *columns], axis=2)[known]
    theta = robust_regression(
        G, residual[known], ridge=SCREENING_RIDGE, exponent=SCREENING_EXPONENT, rounds=SCREENING_ROUNDS
    )
    left = np.full(residual.shape, np.nan)
    left[known] = residual[known] - G @ theta
    return outlier_rows(left, known, visit, criteria)


def _everything(
    aligned: AlignedRecording, pool: CandidatePool, sigma_um: FloatArray, known: BoolArray
) -> list[FloatArray]:
    """Whitened columns of one variant of each effect; time, its square and every quantity, along each coordinate."""
    first_variants: dict[str, Candidate] = {}
    for candidate in pool.candidates:
        first_variants.setdefault(candidate.name, candidate)
    columns = [candidate.columns_um / sigma_um[:, None] for candidate in first_variants.values()]
    time_s = aligned.rows.time_s
    for values in (time_s, time_s**2, *aligned.recording.quantities.values()):
        column = values[known]
        if len(column) and np.isfinite(column).all() and np.ptp(column) > 0:
            scaled = np.nan_to_num(values - column.mean()) / np.ptp(column)
            columns.append(scaled[:, None, None] * np.eye(len(aligned.labels)))
    return columns


def _nuisance_um(comparison: Comparison) -> FloatArray:
    """(N, m, Q) columns of the model's own parameters and of the instrument's frame."""
    aligned = comparison.aligned
    columns = [aligned.columns(fitted.effect, fitted.constants) * UM_PER_MM for fitted in comparison.fitted]
    return np.concatenate([*columns, aligned.registration_columns * UM_PER_MM], axis=2)


def _renumbered(labels: IntArray) -> IntArray:
    """(R,) labels as numbers from 0 without gaps."""
    return np.asarray(np.unique(labels, return_inverse=True)[1], dtype=np.int64)
