"""The search for empirical terms: every covariate at every port in every form, each at its best nonlinear constant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from compd.arrays import FloatArray
from compd.diagnosis.candidates import Candidate
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.empirical_terms import EmpiricalTerm, empirical_terms
from compd.diagnosis.problem import DiagnosisProblem
from compd.diagnosis.regression import RegressionData, Regressors, normal_equations
from compd.diagnosis.significance import OrthogonalComplement
from compd.model.effect import Effect

# Values between neighbours of a grid that are tried for a step, a knee or a period.
REFINED_VALUES = 9
REFINED_FORMS = ("step", "knee", "periodic")
# Terms that are tried on rows left out, of those that explain most where they were fitted.
PROMISING = 60
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

    @property
    def regressors(self) -> Regressors:
        """The columns; nothing is known of their parameters."""
        return Regressors(self.values, np.full(self.values.shape[2], np.inf))

    def candidate(self, columns_um: FloatArray) -> Candidate:
        """The term as a competitor of the library's effects; columns_um (N, m, P) on all rows."""
        name = f"{self.term.covariate} {self.term.form}"
        limits = np.tile([-np.inf, np.inf], (columns_um.shape[2], 1))
        return Candidate(name, self.effect, columns_um, limits, self.searched_parameters)


class EmpiricalSearch:
    """Every empirical term on the rows of a problem, at every value of its nonlinear constant."""

    def __init__(self, problem: DiagnosisProblem) -> None:
        self._problem = problem
        self._fits_by_size: dict[int, list[EmpiricalFit]] = {}
        for term in empirical_terms(problem.aligned, problem.comparison.residual_um):
            effect = term.effect()
            searched = problem.criteria.searched_constant_parameters if term.constant else 0
            for constant in term.grid or (None,):
                values = self._columns(term, effect, constant)
                if np.isfinite(values).all() and values.any():
                    fit = EmpiricalFit(term, effect, constant, values, searched)
                    self._fits_by_size.setdefault(values.shape[2], []).append(fit)

    def best_fits(self, nuisance: FloatArray) -> list[EmpiricalFit]:
        """The PROMISING terms that explain most of the residual beside nuisance columns (R, m, Q), the best first.

        Each is at its best constant; steps, knees and periods are then refined between the values of the grid.
        """
        complement = OrthogonalComplement(nuisance)
        residual = complement(self._problem.data.y)
        best: dict[EmpiricalTerm, tuple[float, EmpiricalFit]] = {}
        for fits in self._fits_by_size.values():
            for fit, explained in zip(fits, _explained_squares(fits, residual, complement).tolist(), strict=True):
                if fit.term not in best or explained > best[fit.term][0]:
                    best[fit.term] = explained, fit
        promising = sorted(best.values(), key=lambda pair: -pair[0])[:PROMISING]
        return [self._refined(fit, residual, complement) for _, fit in promising]

    def _refined(self, fit: EmpiricalFit, residual: FloatArray, complement: OrthogonalComplement) -> EmpiricalFit:
        if fit.constant is None or fit.term.form not in REFINED_FORMS:
            return fit
        fits = [fit]
        for constant in fit.term.refined_grid(fit.constant, REFINED_VALUES):
            values = self._columns(fit.term, fit.effect, constant)
            fits.append(replace(fit, constant=constant, values=values))
        return fits[int(np.argmax(_explained_squares(fits, residual, complement)))]

    def _columns(self, term: EmpiricalTerm, effect: Effect, constant: float | None) -> FloatArray:
        """(R, m, P) whitened columns of a term."""
        return self._problem.whiten(term.columns_um(self._problem.aligned, effect, constant))


def _explained_squares(
    fits: Sequence[EmpiricalFit], residual: FloatArray, complement: OrthogonalComplement
) -> FloatArray:
    """(K,) sum of squares of a residual (R, m) that each fit explains; all have equally many columns.

    What the nuisance columns explain of a fit's columns to one part in 1e6 is held by a ridge and explains nothing.
    """
    explained = []
    size = fits[0].values.shape[2]
    for begin in range(0, len(fits), BATCH):
        columns = np.concatenate([fit.values for fit in fits[begin : begin + BATCH]], axis=2)
        squares = (columns**2).sum(axis=(0, 1)).reshape(-1, size)
        flat = complement(columns).reshape(residual.size, -1)
        score = (flat.T @ residual.ravel()).reshape(-1, size)
        by_fit = flat.reshape(residual.size, -1, size).transpose(1, 0, 2)
        gram = by_fit.transpose(0, 2, 1) @ by_fit
        gram += np.eye(size) * (1e-6 * squares[:, :, None] + 1e-12)
        explained.append((score * np.linalg.solve(gram, score[:, :, None])[:, :, 0]).sum(axis=1))
    return np.concatenate(explained)


def cv_losses_beside(
    nuisance: Regressors, data: RegressionData, fits: Sequence[EmpiricalFit], criteria: Criteria
) -> FloatArray:
    """(K,) cross-validated loss of the nuisance columns with each fit, in squares of the noise floor.

    nan where no split can test a fit.
    """
    equations, indices = normal_equations(replace(data, nuisance=nuisance), [fit.regressors for fit in fits])
    nuisance_index = np.arange(nuisance.values.shape[2])
    testable = np.array([equations.testable_splits(index, criteria.most_in_one_fold) for index in indices])
    return equations.cv_losses([np.concatenate([nuisance_index, index]) for index in indices], testable)


def best_by_covariate(
    losses: FloatArray, fits: Sequence[EmpiricalFit], loss_without: float, criteria: Criteria
) -> list[int]:
    """Places of the best fit of each covariate that can be tested, the best covariate first.

    losses : (K,) cross-validated, of each fit.  loss_without : without any of them.
    Covariates are compared by their loss with `term_share` for each parameter, forms of one with `form_share`.
    """
    testable = [k for k in range(len(fits)) if np.isfinite(losses[k])]

    def first_by_covariate(share: float) -> dict[str, int]:
        per_parameter = criteria.gain_per_parameter + share * max(loss_without - 1.0, 0.0)
        best: dict[str, int] = {}
        for k in sorted(testable, key=lambda k: losses[k] + per_parameter * fits[k].parameter_count):
            best.setdefault(fits[k].term.covariate, k)
        return best

    order = first_by_covariate(criteria.term_share)
    best_forms = first_by_covariate(criteria.form_share)
    return [best_forms[covariate] for covariate in order]
