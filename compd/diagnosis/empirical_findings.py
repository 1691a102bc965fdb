"""What a residual without a known cause follows: descriptions that explain enough not to be chance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.diagnosis.candidates.changes import ChangeCandidate
from compd.diagnosis.candidates.proxies import ProxyCandidate
from compd.diagnosis.findings import EmpiricalFinding, NonlinearConstant
from compd.diagnosis.search.empirical_search import EmpiricalFit
from compd.diagnosis.search.explanation import Explanation
from compd.diagnosis.search.problem import DiagnosisProblem
from compd.diagnosis.search.regression import RegressionData, Regressors, normal_equations
from compd.diagnosis.search.significance import Family, OrthogonalComplement, p_values


def describe_remainder(problem: DiagnosisProblem, explanation: Explanation) -> tuple[EmpiricalFinding, ...]:
    """What the residual beside the effects that were found follows, the strongest first.

    First the descriptions that were chosen together, as one finding; then changes in time; then each further covariate
    alone, where it lowers the log loss by its price and is not chance.
    """
    remainder = _Remainder(problem, explanation)
    findings = [remainder.member(k) for k in (*explanation.proxies, *explanation.changes)]
    if explanation.descriptions:
        chosen = [explanation.fit_of(k) for k in explanation.descriptions]
        findings.insert(0, remainder.finding(chosen, remainder.p_values([chosen])[0], remainder.loss_with(chosen)))
    first = [finding.covariate for finding in findings]
    findings += [finding for finding in remainder.alone() if finding.covariate not in first]
    return tuple(sorted(findings, key=lambda finding: finding.heldout_rms_um))


class _Remainder:
    """The residual beside the effects that were found, the constant and the nuisance."""

    def __init__(self, problem: DiagnosisProblem, explanation: Explanation) -> None:
        self._problem, self._explanation = problem, explanation
        losses, named = explanation.losses, explanation.named
        self._data = replace(problem.data, nuisance=losses.nuisance_with(named))
        self._loss = losses.loss(named)
        self._begin_s = problem.aligned.recording.begin_s

    def loss_with(self, fits: Sequence[EmpiricalFit]) -> float:
        """Cross-validated loss with some terms together."""
        return float(self._losses([fits])[0])

    def alone(self) -> list[EmpiricalFinding]:
        """The best term of each covariate that is worth its price and not chance."""
        criteria, losses = self._problem.criteria, self._explanation.losses
        fits = self._explanation.fits
        if not fits:
            return []
        by_fit = self._losses([[fit] for fit in fits])
        scores = [losses.log_loss(loss) + fit.price(criteria) for fit, loss in zip(fits, by_fit, strict=True)]
        best: dict[str, int] = {}
        for k in sorted((k for k in range(len(fits)) if np.isfinite(by_fit[k])), key=lambda k: scores[k]):
            best.setdefault(fits[k].term.covariate, k)
        order = [*best.values(), *(k for k in range(len(fits)) if np.isfinite(by_fit[k]) and k not in best.values())]
        p_value_by_fit = dict(zip(order, self.p_values([[fits[k]] for k in order]), strict=True))
        return [
            self.finding([fits[k]], p_value_by_fit[k], float(by_fit[k]))
            for k in best.values()
            if scores[k] <= losses.log_loss(self._loss) and p_value_by_fit[k] <= criteria.p_value
        ]

    def p_values(self, families: Sequence[Sequence[EmpiricalFit]]) -> list[float]:
        """Of the columns of each family together."""
        complement = OrthogonalComplement(self._data.nuisance.values)
        columns = [complement(np.concatenate([fit.values for fit in family], axis=2)) for family in families]
        y = complement(self._data.y)
        values: list[float] = p_values(
            [Family([together], y) for together in columns],
            self._data.block,
            self._problem.criteria.search.sign_flips,
        ).tolist()
        return values

    def member(self, k: int) -> EmpiricalFinding:
        """An effect that changes at a moment, or that another quantity stands for, as a finding."""
        losses = self._explanation.losses
        candidate = losses.candidates[k]
        theta, _ = losses.estimates(self._explanation.members)[self._explanation.members.index(k)]
        names = [column.name for column in candidate.effect.columns(self._problem.aligned.rows.links)]
        rest = [member for member in self._explanation.members if member != k]
        complement = OrthogonalComplement(losses.nuisance_with(rest).values)
        own = Family([complement(losses.values[k])], complement(losses.data.y))
        p_value = float(p_values([own], losses.data.block, losses.criteria.search.sign_flips)[0])
        loss, without = losses.loss(self._explanation.members), losses.loss(rest)
        covariate = candidate.quantity if isinstance(candidate, ProxyCandidate) else "time_s"
        units = {constant.name: constant.unit for constant in candidate.effect.constants}
        return EmpiricalFinding(
            covariate=covariate,
            form=candidate.kind,
            port=candidate.effect.port,
            p_value=p_value,
            explained_fraction=self._fraction(without, loss),
            heldout_rms_um=self._rms_um(loss),
            formula_effects=(),
            parameters=(dict(zip(names, theta.tolist(), strict=True)),),
            effect=candidate.effect.id,
            time_s=self._begin_s + candidate.time_s if isinstance(candidate, ChangeCandidate) else float("nan"),
            constants=tuple(
                NonlinearConstant(covariate, name, value, units[name]) for name, value in candidate.constants.items()
            ),
        )

    def finding(self, fits: Sequence[EmpiricalFit], p_value: float, loss: float) -> EmpiricalFinding:
        """Terms together with their formulas, parameters fitted on all rows; the first covariate is the larger part."""
        equations, indices = normal_equations(self._data, [fit.regressors for fit in fits])
        theta, _, _ = equations.estimate(np.concatenate([np.arange(self._data.nuisance.values.shape[2]), *indices]))
        parts: list[tuple[float, str, dict[str, Any], dict[str, float]]] = []
        for fit, index in zip(fits, indices, strict=True):
            names = [column.name for column in fit.effect.columns(self._problem.aligned.rows.links)]
            for number, axis in enumerate(fit.term.axes):
                of_axis = slice(number * len(names), (number + 1) * len(names))
                values = theta[index][of_axis]
                parameters = dict(zip(names, values.tolist(), strict=True))
                sizes = {
                    parameter.name: max(
                        abs(v) for name, v in parameters.items() if name.split("_")[0] == parameter.name
                    )
                    for parameter in fit.effect.parameters
                }
                squares = float(((fit.values[:, :, of_axis] @ values) ** 2).sum())
                declaration = fit.term.declaration(axis, fit.constant, sizes)
                parts.append((squares, fit.term.covariate, declaration, parameters))
        parts.sort(key=lambda part: -part[0])
        least = self._problem.criteria.descriptions.min_direction_share * sum(part[0] for part in parts)
        kept = [part for part in parts if part[0] >= least]
        main_fit = next(fit for fit in fits if fit.term.covariate == parts[0][1])
        main = main_fit.term
        return EmpiricalFinding(
            covariate=main.covariate,
            form=main.form,
            port=main.port,
            p_value=p_value,
            explained_fraction=self._fraction(self._loss, loss),
            heldout_rms_um=self._rms_um(loss),
            formula_effects=tuple(part[2] for part in kept),
            parameters=tuple(part[3] for part in kept),
            beside=tuple(dict.fromkeys(f.term.covariate for f in fits if f.term.covariate != main.covariate)),
            constants=tuple(
                NonlinearConstant(fit.term.covariate, fit.term.constant, fit.constant, fit.term.constant_unit)
                for fit in fits
                if fit.constant is not None
            ),
            time_s=self._begin_s + main_fit.constant
            if main.form == "step" and main_fit.constant is not None
            else math.nan,
        )

    def _losses(self, families: Sequence[Sequence[EmpiricalFit]]) -> FloatArray:
        """(K,) cross-validated loss with each family of terms; nan where no split can test it."""
        return cv_losses_beside(self._data, families, self._problem.criteria.most_in_one_fold)

    def _rms_um(self, loss: float) -> float:
        return self._problem.unit_um * float(np.sqrt(max(loss, 0.0)))

    def _fraction(self, before: float, after: float) -> float:
        """Share of what is above the noise floor that is explained, at most 1."""
        floor = 1.0 if self._problem.floor_known else 0.0
        return float(min((before - after) / max(before - floor, before - after, 1e-300), 1.0))


def cv_losses_beside(
    data: RegressionData, families: Sequence[Sequence[EmpiricalFit]], most_in_one_fold: float
) -> FloatArray:
    """(K,) cross-validated loss of the nuisance columns with each family of terms, in squares of the noise floor."""
    columns = [np.concatenate([fit.values for fit in family], axis=2) for family in families]
    equations, indices = normal_equations(data, [Regressors(v, np.full(v.shape[2], np.inf)) for v in columns])
    nuisance_index = np.arange(data.nuisance.values.shape[2])
    testable = np.array([equations.testable_splits(index, most_in_one_fold) for index in indices])
    return equations.cv_losses([np.concatenate([nuisance_index, index]) for index in indices], testable)
