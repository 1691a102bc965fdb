"""The search for empirical terms: every covariate at every port in every form, each at its best nonlinear constant."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from compd.arrays import FloatArray
from compd.comparison import AlignedRecording
from compd.diagnosis.candidates.candidates import Candidate
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.descriptions.empirical_terms import EmpiricalTerm, FactorsUm, empirical_terms
from compd.diagnosis.search.problem import DiagnosisProblem
from compd.diagnosis.search.regression import Regressors
from compd.diagnosis.search.significance import OrthogonalComplement
from compd.model.effects import Effect

REFINED_FORMS = ("step", "knee", "periodic")
# Terms that are computed at once: a balance of memory and overhead.
BATCH = 64


@dataclass(frozen=True, eq=False)
class EmpiricalFit:
    """An empirical term at one value of its nonlinear constant, whitened.

    effect : the term's formula.  constant : the value; None for a term without one.
    values : (R, m, P) columns in standard deviations of the noise, on the rows of the problem.
    searched_parameters : for how many parameters the search for the constant counts.
    """

    term: EmpiricalTerm
    effect: Effect
    constant: float | None
    values: FloatArray
    searched_parameters: int

    @property
    def parameter_count(self) -> int:
        """Fitted parameters, and what the search for the constant counts for."""
        return int(self.values.shape[2]) + self.searched_parameters

    def columns_um(self, aligned: AlignedRecording) -> FloatArray:
        """(N, m, P) by how many um each parameter moves the prediction, on all rows."""
        return self.term.columns_um(aligned, self.effect, self.constant)

    def price(self, criteria: Criteria) -> float:
        """By how much it must lower the logarithm of the loss."""
        return criteria.description_price + criteria.number_price * (self.parameter_count - 1)

    @property
    def regressors(self) -> Regressors:
        """The columns; nothing is known of their parameters."""
        return Regressors(self.values, np.full(self.values.shape[2], np.inf))

    def candidate(self, columns_um: FloatArray) -> Candidate:
        """The term as a competitor of the library's effects; columns_um (N, m, P) on all rows."""
        name = f"{self.term.covariate} {self.term.form}"
        limits = np.tile([-np.inf, np.inf], (columns_um.shape[2], 1))
        return Candidate(
            name, self.effect, columns_um, limits, self.searched_parameters, self.constants, kind="description"
        )

    @property
    def constants(self) -> dict[str, float]:
        """Values of the formula's nonlinear constants."""
        return self.term.constant_values(self.constant)


class EmpiricalSearch:
    """Every empirical term on the rows of a problem, at every value of its nonlinear constant."""

    def __init__(self, problem: DiagnosisProblem) -> None:
        self._problem, self._criteria = problem, problem.criteria.descriptions
        searched_constant = problem.criteria.candidates.searched_constant
        # which term is worth a contest shows on few rows
        self._screened = slice(None, None, max(1, len(problem.data.y) // self._criteria.screened_rows))
        self._fits: list[EmpiricalFit] = []
        factors_um: FactorsUm = {}
        for term in empirical_terms(problem.aligned, problem.comparison.residual_um, self._criteria):
            effect = term.effect()
            searched = searched_constant if term.constant else 0
            for constant in term.grid or (None,):
                values = problem.whiten(term.columns_um(problem.aligned, effect, constant, factors_um))
                if np.isfinite(values).all() and values.any():
                    self._fits.append(EmpiricalFit(term, effect, constant, values[self._screened], searched))

    def best_fits(self, nuisance: FloatArray) -> list[EmpiricalFit]:
        """The `promising` terms that explain most of the residual beside nuisance columns (R, m, Q), the best first.

        Each is at its best constant; steps, knees and periods are then refined between the values of the grid. Not
        more than `max_per_covariate` are of one covariate: else forms of the first would leave no place for the second.
        """
        complement = OrthogonalComplement(nuisance[self._screened])
        residual = complement(self._problem.data.y[self._screened])
        best: dict[EmpiricalTerm, tuple[float, EmpiricalFit]] = {}
        squares = explained_squares([fit.values for fit in self._fits], residual, complement).tolist()
        for fit, explained in zip(self._fits, squares, strict=True):
            if fit.term not in best or explained > best[fit.term][0]:
                best[fit.term] = explained, fit
        taken: Counter[str] = Counter()
        promising: list[EmpiricalFit] = []
        deducted = self._criteria.squares_per_number
        for _, fit in sorted(best.values(), key=lambda pair: deducted * pair[1].parameter_count - pair[0]):
            taken[fit.term.covariate] += 1
            if (
                taken[fit.term.covariate] <= self._criteria.max_per_covariate
                and len(promising) < self._criteria.promising
            ):
                refined = self._refined(fit, residual, complement)
                promising.append(replace(refined, values=self._columns(fit.term, fit.effect, refined.constant)))
        return promising

    def _refined(self, fit: EmpiricalFit, residual: FloatArray, complement: OrthogonalComplement) -> EmpiricalFit:
        if fit.constant is None or fit.term.form not in REFINED_FORMS:
            return fit
        fits = [fit]
        for constant in fit.term.refined_grid(fit.constant, self._criteria.refined_values, self._criteria):
            values = self._columns(fit.term, fit.effect, constant)[self._screened]
            fits.append(replace(fit, constant=constant, values=values))
        return fits[int(np.argmax(explained_squares([fit.values for fit in fits], residual, complement)))]

    def _columns(self, term: EmpiricalTerm, effect: Effect, constant: float | None) -> FloatArray:
        """(R, m, P) whitened columns of a term."""
        return self._problem.whiten(term.columns_um(self._problem.aligned, effect, constant))


def explained_squares(
    values: Sequence[FloatArray], residual: FloatArray, complement: OrthogonalComplement
) -> FloatArray:
    """(K,) sum of squares of a residual (R, m) that each set of columns (R, m, P) explains.

    What the nuisance columns explain of a set to one part in 1e6 is held by a ridge and explains nothing.
    """
    explained = np.zeros(len(values))
    sizes = np.array([columns.shape[2] for columns in values], dtype=np.int64)
    for size in np.unique(sizes):
        indices = np.flatnonzero(sizes == size)
        for begin in range(0, len(indices), BATCH):
            batch = indices[begin : begin + BATCH]
            columns = np.concatenate([values[k] for k in batch], axis=2)
            squares = (columns**2).sum(axis=(0, 1)).reshape(-1, size)
            flat = complement(columns).reshape(residual.size, -1)
            score = (flat.T @ residual.ravel()).reshape(-1, size)
            by_set = np.ascontiguousarray(flat.T).reshape(-1, size, residual.size)
            gram = by_set @ by_set.transpose(0, 2, 1)
            gram += np.eye(size) * (1e-6 * squares[:, :, None] + 1e-12)
            explained[batch] = (score * np.linalg.solve(gram, score[:, :, None])[:, :, 0]).sum(axis=1)
    return explained
