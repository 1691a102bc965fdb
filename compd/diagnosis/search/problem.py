"""What a diagnosis has to explain: the whitened residual on the rows that count, and each candidate's columns there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtri

from compd.arrays import BoolArray, FloatArray, IntArray, rms
from compd.comparison import AlignedRecording, Comparison, neighbour_blocks, nuisance_columns
from compd.diagnosis.candidates.candidates import Candidate, CandidatePool
from compd.diagnosis.candidates.constant import constant_candidate, split_constants
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.search.cross_validation import row_places, row_splits
from compd.diagnosis.search.gross_rows import RowWeights, weigh_rows
from compd.diagnosis.search.regression import RegressionData, Regressors, normal_equations
from compd.diagnosis.search.subset_losses import SubsetLosses
from compd.statistics import filled
from compd.units import UM_PER_MM


@dataclass(frozen=True, eq=False)
class DiagnosisProblem:
    """The residual of one comparison in standard deviations of the noise, with the candidates for it.

    N rows of the recording, R of which count; m coordinates.

    comparison : of the recording with the model as it is.  pool : effects of the library, and what cannot be tested.
    candidates : the library's that compete, and the constant.
    same_as_nuisance : effects that do nothing on these rows but what is fitted along in any case.
    criteria : numbers of the verdict.  sigma_um : (m,) standard deviation of the noise, or a unit where it is unknown.
    known : (N,) rows in which the residual and all candidates are known.
    weights : of the rows, and which are gross.  rows : (N,) those that count: known and not gross.
    root_weight : (R,) root of each row's weight, by which residual and columns are multiplied.
    residual : (N, m) whitened, nan where not known.  nuisance : (N, m, Q) whitened columns of what every fit contains.
    data : residual and nuisance columns on the rows that count, weighted, and how these are divided.
    states : how many of the nuisance columns are unknown states at the start of sessions.
    """

    comparison: Comparison
    pool: CandidatePool
    candidates: tuple[Candidate, ...]
    same_as_nuisance: tuple[Candidate, ...]
    criteria: Criteria
    sigma_um: FloatArray
    known: BoolArray
    weights: RowWeights
    rows: BoolArray
    root_weight: FloatArray
    residual: FloatArray
    nuisance: FloatArray
    data: RegressionData
    states: int = 0

    @property
    def gross(self) -> BoolArray:
        """(N,) rows that nothing explains."""
        return self.weights.gross

    @property
    def aligned(self) -> AlignedRecording:
        """The recording."""
        return self.comparison.aligned

    @property
    def floor_known(self) -> bool:
        """Whether the noise was measured or declared."""
        return self.comparison.floor.known

    def is_at_floor(self, loss: float) -> bool:
        """Whether a loss is so near the noise that nothing worth a name is left; never where the noise is not known."""
        return self.floor_known and loss <= self.criteria.most_at_floor * self.least_loss

    @property
    def least_loss(self) -> float:
        """Below which nothing is gained: 1, the noise; more where rounding that repeats have in common makes most of
        it; 0 where the noise is not known.

        What rounding takes off follows from the value, and over a row of places it is as regular as they are: an effect
        within half a step, sqrt(3) times the digit's uncertainty, cannot be told from it.
        """
        if not self.floor_known:
            return 0.0
        half_step = 3.0 * float(np.mean((self.comparison.floor.unseen_um / self.sigma_um) ** 2))
        return max(1.0, half_step / self.criteria.most_at_floor)

    def above_floor(self, loss: float) -> float:
        """By how much a loss is above the least one, 0 at least; nan where the noise is not known."""
        return max(loss - self.least_loss, 0.0) if self.floor_known else float("nan")

    def may_be_noise(self, loss: float) -> bool:
        """Whether a loss at which nothing more was found is at the floor, or chance as the floor is from few repeats.

        By the F distribution, as in a comparison.
        """
        dof = min(self.comparison.floor.dof, 1e9)
        by_chance = fdtri(self.data.value_count, dof, self.comparison.criteria.at_floor_confidence)
        return self.is_at_floor(loss) or (self.floor_known and loss <= float(by_chance))

    @property
    def unit_um(self) -> float:
        """Error per coordinate at a loss of 1, um; of lengths alone where an attitude is measured beside them."""
        return rms(self.sigma_um[self.aligned.lengths])

    def whiten(self, columns_um: FloatArray) -> FloatArray:
        """(R, m, P) columns (N, m, P) in um, whitened and weighted, on the rows that count."""
        return np.asarray(columns_um[self.rows] / self.sigma_um[:, None] * self.root_weight[:, None, None])

    def on_splits_that_test(self, columns_um: FloatArray) -> DiagnosisProblem | None:
        """The problem with those of its splits that can test each of some columns (N, m, Q) in um; None without any."""
        columns = self.whiten(columns_um)
        own = [Regressors(columns[:, :, k : k + 1], np.full(1, np.inf)) for k in range(columns.shape[2])]
        equations, indices = normal_equations(self.data, own)
        share = self.criteria.most_in_one_fold
        testable = np.all([equations.testable_splits(index, share) for index in indices], axis=0)
        splits = tuple(fold for fold, tests in zip(self.data.splits, testable, strict=True) if tests)
        return replace(self, data=replace(self.data, splits=splits)) if splits else None

    def with_states(self, columns_um: FloatArray) -> DiagnosisProblem:
        """The problem with columns (N, m, Q) in um of unknown states in every fit."""
        values, count = self.whiten(columns_um), columns_um.shape[2]
        nuisance = self.data.nuisance
        more = Regressors(
            np.concatenate([nuisance.values, values], axis=2), np.append(nuisance.largest, np.full(count, np.inf))
        )
        return replace(
            self,
            nuisance=np.concatenate([self.nuisance, columns_um / self.sigma_um[:, None]], axis=2),
            data=replace(self.data, nuisance=more),
            states=self.states + count,
        )

    def residual_beside_um(self, losses: SubsetLosses, members: Sequence[int]) -> FloatArray:
        """(N, m) what some members, fitted on the rows that count, leave; nan where a row does not count."""
        columns = [losses.candidates[k].columns_um / self.sigma_um[:, None] for k in members]
        G = np.concatenate([self.nuisance, *columns], axis=2)
        theta, _, _ = losses.equations.estimate(losses.index(members))
        left = (self.residual - G[:, :, : len(theta)] @ theta) * self.sigma_um
        return np.where(self.rows[:, None], left, np.nan)

    def losses(self, candidates: Sequence[Candidate]) -> SubsetLosses:
        """Of all sets of these candidates."""
        values = [self.whiten(candidate.columns_um) for candidate in candidates]
        return SubsetLosses(self.data, candidates, values, self.criteria, self.least_loss)

    def weigh_beside(self, candidates: Sequence[Candidate]) -> RowWeights:
        """What each row counts beside some candidates alone."""
        columns = [self.nuisance, *(candidate.columns_um / self.sigma_um[:, None] for candidate in candidates)]
        return _weights(self.comparison, columns, self.residual, self.known, self.sigma_um, self.criteria)


def build_problem(
    comparison: Comparison, pool: CandidatePool, criteria: Criteria, weights: RowWeights | None = None
) -> DiagnosisProblem:
    """Whiten the residual and the candidates of a comparison.

    weights : of the rows; None to weigh them beside everything that could explain a row. What a candidate could
        explain does not make a row gross then, and hides no gross row either: behind an effect of six times the noise
        an error of twenty times would be hidden.
    """
    aligned = comparison.aligned
    sigma_um = _unit_um(comparison)
    fitted_along_um = fitted_along_columns(comparison)
    known: BoolArray = np.asarray(np.isfinite(comparison.residual_um).all(axis=1))
    for columns in (fitted_along_um, *(candidate.columns_um for candidate in (*pool.candidates, *pool.proxies))):
        known &= np.isfinite(columns).all(axis=(1, 2))
    candidates, same = split_constants(pool.candidates, fitted_along_um, known)
    candidates += pool.proxies
    constant = constant_candidate(aligned)
    if constant is not None:
        candidates = (*candidates, constant)
    residual = comparison.residual_um / sigma_um
    nuisance = fitted_along_um / sigma_um[:, None]
    if weights is None:
        everything = [nuisance, *_everything(aligned, candidates, sigma_um, known)]
        weights = _weights(comparison, everything, residual, known, sigma_um, criteria)
    rows = known & ~weights.gross
    root = np.sqrt(weights.weight[rows])
    data = RegressionData(
        residual[rows] * root[:, None],
        tuple(_renumbered(fold[rows]) for fold in row_splits(aligned, criteria.folds)),
        _renumbered(neighbour_blocks(aligned.recording, aligned.criteria.blocks)[rows]),
        Regressors(nuisance[rows] * root[:, None, None], np.full(nuisance.shape[2], np.inf)),
        _renumbered(row_places(aligned, criteria.folds)[rows]),
    )
    return DiagnosisProblem(
        comparison=comparison,
        pool=pool,
        candidates=candidates,
        same_as_nuisance=same,
        criteria=criteria,
        sigma_um=sigma_um,
        known=known,
        weights=weights,
        rows=rows,
        root_weight=root,
        residual=residual,
        nuisance=nuisance,
        data=data,
    )


def _weights(
    comparison: Comparison,
    columns: Sequence[FloatArray],
    residual: FloatArray,
    known: BoolArray,
    sigma_um: FloatArray,
    criteria: Criteria,
) -> RowWeights:
    """What each row counts beside whitened columns."""
    aligned, floor = comparison.aligned, comparison.floor
    return weigh_rows(
        columns,
        residual,
        known,
        aligned.recording.visit,
        1.0 if floor.known else 0.0,
        criteria,
        aligned.criteria.huber_sigmas,
        floor.least_um / sigma_um,
        aligned.lone_distance,
    )


def _unit_um(comparison: Comparison) -> FloatArray:
    """(m,) noise of each coordinate; where it is not known the residual's own size, alike for all of one unit."""
    if comparison.floor.known:
        return comparison.floor.by_axis_um
    return comparison.aligned.scatter_by_unit(comparison.residual_um[np.isfinite(comparison.residual_um).all(axis=1)])


def _everything(
    aligned: AlignedRecording, candidates: Sequence[Candidate], sigma_um: FloatArray, known: BoolArray
) -> list[FloatArray]:
    """Whitened columns of one variant of each effect; time, its square and every quantity, along each coordinate."""
    first_variants: dict[str, Candidate] = {}
    for candidate in candidates:
        first_variants.setdefault(candidate.name, candidate)
    columns = [candidate.columns_um / sigma_um[:, None] for candidate in first_variants.values()]
    time_s = aligned.rows.time_s
    for values in (time_s, time_s**2, *aligned.gaps_filled.rows.quantities.values()):
        without_gaps = filled(values, time_s, aligned.criteria.max_filled_share)
        column = without_gaps[known]
        if len(column) and np.isfinite(column).all() and np.ptp(column) > 0:
            scaled = np.nan_to_num(without_gaps - column.mean()) / np.ptp(column)
            columns.append(scaled[:, None, None] * np.eye(len(aligned.labels)))
    return columns


def fitted_along_columns(comparison: Comparison) -> FloatArray:
    """(N, m, Q) columns of the model's own parameters and of what is fitted along: frame, constant, starts of lags."""
    aligned = comparison.aligned
    columns = [aligned.columns(fitted.effect, fitted.constants) * UM_PER_MM for fitted in comparison.fitted]
    return np.concatenate([*columns, nuisance_columns(aligned, comparison.fitted)], axis=2)


def _renumbered(labels: IntArray) -> IntArray:
    """(R,) labels as numbers from 0 without gaps."""
    return np.asarray(np.unique(labels, return_inverse=True)[1], dtype=np.int64)
