"""Effects that may explain the residual of a comparison: each alone, ranked, and one of them as a card with trials."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.comparison import Comparison, compare, thinned
from compd.diagnosis import (
    Candidate,
    CandidateResult,
    Criteria,
    DiagnosisProblem,
    SubsetLosses,
    build_problem,
    candidate_pool,
    candidate_results,
    collinearity,
    fitted_along_columns,
)
from compd.model.effects import Effect
from compd.page.workbench.trial import Trial, trial
from compd.text import nan_to_null
from compd.units import UM_PER_MM

# Least cosine of effects that count as alike: a tenth of either's square is its own.
MIN_COSINE = 0.95
MAX_ALIKE = 4


class Candidates:
    """The effects of a library against one comparison. Results that take a second are computed on demand."""

    def __init__(
        self, comparison: Comparison, library: Sequence[Effect], weighed: DiagnosisProblem | None = None
    ) -> None:
        """weighed : row weights of the same comparison; None to compute them anew."""
        self._comparison = comparison
        self._weighed = weighed
        self._criteria = Criteria() if weighed is None else weighed.criteria
        self.library = {effect.id: effect for effect in library}

    @cached_property
    def _searched(self) -> Comparison:
        """The rows that effects are ranked on: evenly thinned if very many, as for a diagnosis."""
        full = self._comparison
        thin = thinned(full.aligned, self._criteria.search.max_rows)
        return full if thin is full.aligned else compare(thin, full.fitted)

    @cached_property
    def problem(self) -> DiagnosisProblem:
        """The residual and the columns of every effect."""
        searched = self._searched
        pool = candidate_pool(searched, list(self.library.values()), self._criteria.candidates)
        weights = None if self._weighed is None else self._weighed.weights
        return build_problem(searched, pool, self._criteria, weights)

    @cached_property
    def losses(self) -> SubsetLosses:
        """The loss of each on rows left out."""
        return self.problem.losses(self.problem.candidates)

    def summary(self) -> dict[str, Any]:
        """Every effect, ranked, and the model's error on rows left out, as plain data."""
        summary: dict[str, Any] = nan_to_null(
            {
                "effects": self.ranked(),
                "left_out_rms": self._rms(self.losses.baseline),
                "rows": int(self.problem.rows.sum()),
            }
        )
        return summary

    @property
    def is_noise(self) -> bool:
        """Whether the error is at the noise floor, and no effect alone takes enough of it for a name."""
        results = candidate_results(self.problem, self.losses, (), {})
        may_be_named = any(result.status in ("explains", "partial") for result in results)
        return self.problem.is_at_floor(self.losses.baseline) and not may_be_named

    def _rms(self, loss: float) -> float:
        """The error per coordinate at a loss, um."""
        return self.problem.unit_um * float(np.sqrt(max(loss, 0.0)))

    def ranked(self) -> list[dict[str, Any]]:
        """Every effect with the reason for its rank, in the order of the error on rows left out."""
        results = candidate_results(self.problem, self.losses, (), {})
        ranking: list[dict[str, Any]] = nan_to_null([self._result(result) for result in results])
        return ranking

    def _result(self, result: CandidateResult) -> dict[str, Any]:
        effect = self.library.get(result.effect)
        return {
            "effect": result.effect,
            "status": result.status,
            "why": result.why,
            "left_out_rms": result.heldout_rms_um,
            "explained": result.explained_fraction,
            "physics": "" if effect is None else effect.physics,
        }

    def card(self, name: str) -> dict[str, Any]:
        """An effect's description, its numbers with plausible ranges, and its fit alone at each choice of constants.

        Raises KeyError if there is no such effect.
        """
        effect, links = self.library[name], self._comparison.aligned.rows.links
        card: dict[str, Any] = nan_to_null(
            {
                "effect": effect.id,
                "physics": effect.physics,
                "equation": effect.equation,
                "symbols": dict(effect.symbols),
                "source": effect.source,
                "mistaken_for": list(effect.mistaken_for),
                "separated_by": effect.separated_by,
                "numbers": [
                    {
                        "name": column.name,
                        "unit": column.parameter.unit,
                        "low": column.parameter.low,
                        "high": column.parameter.high,
                        "range": list(column.parameter.theta_range),
                        "reciprocal": column.parameter.reciprocal,
                        "source": column.parameter.source,
                    }
                    for column in effect.columns(links)
                ],
                "constants": [
                    {"name": constant.name, "unit": constant.unit, "low": constant.low, "high": constant.high}
                    for constant in effect.constants
                ],
                "variants": [self._variant(k) for k in self._variants(name)],
                "alike": self._alike(name),
                "why_not": self.problem.pool.untestable.get(name, ""),
            }
        )
        return card

    def trial(self, name: str, variant: int) -> Trial:
        """The effect at one choice of its constants, by the index in `card`.

        Raises KeyError or IndexError where there is none.
        """
        candidate = self._candidate(self._variants(name)[variant])
        aligned = self._comparison.aligned
        columns_um = candidate.columns_um
        if self._searched is not self._comparison:
            columns_um = aligned.columns(candidate.effect, candidate.constants) * UM_PER_MM
        return trial(self._comparison, fitted_along_columns(self._comparison), columns_um, candidate.constants)

    def _candidate(self, k: int) -> Candidate:
        return self.problem.candidates[k]

    def _variants(self, name: str) -> list[int]:
        """Indices of an effect's candidates; empty if it cannot be tried."""
        candidates = self.problem.candidates
        places = [k for k, candidate in enumerate(candidates) if candidate.name == name and candidate.kind == "effect"]
        return sorted(places, key=lambda k: self.losses.loss((k,)))

    def _alike(self, name: str) -> list[dict[str, Any]]:
        """Effects that are similar on these rows, with the cosine between both, the most similar first."""
        if name not in self.losses.best_variants:
            return []
        (own,) = self.losses.best_variants[name].members
        cosine_by_effect = {
            other: collinearity(self.losses, (), own, subset.members[0])
            for other, subset in self.losses.best_variants.items()
            if other != name and self.losses.candidates[subset.members[0]].kind == "effect"
        }
        nearest = sorted(cosine_by_effect, key=lambda other: -cosine_by_effect[other])[:MAX_ALIKE]
        return [
            {"effect": other, "cosine": cosine_by_effect[other]}
            for other in nearest
            if cosine_by_effect[other] >= MIN_COSINE
        ]

    def _variant(self, k: int) -> dict[str, Any]:
        candidate = self._candidate(k)
        (theta, covariance), loss = self.losses.estimates((k,))[0], self.losses.loss((k,))
        return {
            "constants": dict(candidate.constants),
            "theta": _numbers(theta),
            "standard_error": _numbers(np.sqrt(np.diag(covariance))),
            "left_out_rms": self._rms(loss),
        }


def _numbers(values: FloatArray) -> list[float]:
    return [float(value) for value in values]
