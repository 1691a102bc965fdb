"""What a residual without a known cause follows: empirical terms that explain enough not to be chance."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.empirical_search import EmpiricalFit, best_by_covariate
from compd.diagnosis.findings import EmpiricalFinding
from compd.diagnosis.regression import RegressionData, normal_equations
from compd.diagnosis.significance import OrthogonalComplement, p_values


class Remainder(NamedTuple):
    """What is to be described.

    data : the residual, its nuisance columns being those of the effects that were found as well.
    loss : cross-validated, of the nuisance columns alone, in squares of the noise floor.
    noise_um : the noise floor.  least_gain : what a term must explain, in squares of the floor.
    links : of the machine.
    """

    data: RegressionData
    loss: float
    noise_um: float
    least_gain: float
    links: int

    def rms_um(self, loss: float) -> float:
        """Error per coordinate at a loss."""
        return self.noise_um * float(np.sqrt(max(loss, 0.0)))

    def explained_fraction(self, loss: float) -> float:
        """Share of what is above the noise floor that is explained at a loss, at most 1."""
        return float(min((self.loss - loss) / max(self.loss - 1.0, self.loss - loss), 1.0))


def rank_findings(
    remainder: Remainder, fits: Sequence[EmpiricalFit], losses: FloatArray, criteria: Criteria
) -> tuple[EmpiricalFinding, ...]:
    """The best term of each covariate, the one that explains most first, without those that may be chance.

    losses : (K,) cross-validated, of each fit beside the nuisance columns.
    """
    first = best_by_covariate(losses, fits, remainder.loss, criteria)
    if not first:
        return ()
    order = [*first, *(k for k in range(len(fits)) if np.isfinite(losses[k]) and k not in first)]
    p_value_by_place = dict(zip(order, _p_values(remainder, [[fits[k]] for k in order]), strict=True))
    return tuple(
        _finding(remainder, [fits[k]], p_value_by_place[k], float(losses[k]), criteria)
        for k in first
        if remainder.loss - losses[k] >= remainder.least_gain and p_value_by_place[k] <= criteria.p_value
    )


def find_pair(
    remainder: Remainder, fits: Sequence[EmpiricalFit], best_loss: float, criteria: Criteria
) -> tuple[EmpiricalFinding, ...]:
    """The two terms of different covariates that explain most together; none where one nearly does as well.

    best_loss : cross-validated, of the best term alone.
    """
    pairs = [(a, b) for a, b in combinations(range(len(fits)), 2) if fits[a].term.covariate != fits[b].term.covariate]
    equations, indices = normal_equations(remainder.data, [fit.regressors for fit in fits])
    nuisance_index = np.arange(remainder.data.nuisance.values.shape[2])
    testable = np.array([equations.testable_splits(index, criteria.most_in_one_fold) for index in indices])
    sets = [np.concatenate([nuisance_index, indices[a], indices[b]]) for a, b in pairs]
    losses = equations.cv_losses(sets, np.array([testable[a] & testable[b] for a, b in pairs]))
    if not np.isfinite(losses).any():
        return ()
    best = int(np.nanargmin(losses))
    loss = float(losses[best])
    pair = [fits[k] for k in pairs[best]]
    excess = max(loss - 1.0, 0.0)
    if best_loss - loss < remainder.least_gain or best_loss - 1.0 < excess / (1 - criteria.pair_share):
        return ()
    p_value = _p_values(remainder, [pair])[0]
    return (_finding(remainder, pair, p_value, loss, criteria),) if p_value <= criteria.p_value else ()


def _p_values(remainder: Remainder, families: Sequence[Sequence[EmpiricalFit]]) -> list[float]:
    """Of the columns of each family together; the first family is taken to be the explanation."""
    data = remainder.data
    complement = OrthogonalComplement(data.nuisance.values)
    columns = [complement(np.concatenate([fit.values for fit in family], axis=2)) for family in families]
    y = complement(data.y)
    noise = OrthogonalComplement(columns[0])(y)
    values: list[float] = p_values([[family] for family in columns], y, noise, data.block).tolist()
    return values


def _finding(
    remainder: Remainder, fits: Sequence[EmpiricalFit], p_value: float, loss: float, criteria: Criteria
) -> EmpiricalFinding:
    """The finding with its formulas, parameters fitted on all rows; the first covariate is the larger part."""
    equations, indices = normal_equations(remainder.data, [fit.regressors for fit in fits])
    theta, _, _ = equations.estimate(np.concatenate([np.arange(remainder.data.nuisance.values.shape[2]), *indices]))
    parts: list[tuple[float, str, dict[str, Any], dict[str, float]]] = []
    for fit, index in zip(fits, indices, strict=True):
        names = [column.name for column in fit.effect.columns(remainder.links)]
        for number, axis in enumerate(fit.term.axes):
            of_axis = slice(number * len(names), (number + 1) * len(names))
            values = theta[index][of_axis]
            parameters = dict(zip(names, values.tolist(), strict=True))
            sizes = {
                parameter.name: max(abs(v) for name, v in parameters.items() if name.split("_")[0] == parameter.name)
                for parameter in fit.effect.parameters
            }
            squares = float(((fit.values[:, :, of_axis] @ values) ** 2).sum())
            declaration = fit.term.declaration(axis, fit.constant, sizes)
            parts.append((squares, fit.term.covariate, declaration, parameters))
    parts.sort(key=lambda part: -part[0])
    least = criteria.direction_share * sum(part[0] for part in parts)
    kept = [part for part in parts if part[0] >= least]
    main = next(fit for fit in fits if fit.term.covariate == parts[0][1]).term
    return EmpiricalFinding(
        covariate=main.covariate,
        form=main.form,
        port=main.port,
        p_value=p_value,
        explained_fraction=remainder.explained_fraction(loss),
        heldout_rms_um=remainder.rms_um(loss),
        formula_effects=tuple(part[2] for part in kept),
        parameters=tuple(part[3] for part in kept),
        beside=tuple(fit.term.covariate for fit in fits if fit.term.covariate != main.covariate),
    )
