"""Subset selection and rivals on synthetic columns, where the right answer is known by construction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.diagnosis.candidates import Candidate
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.regression import RegressionData, Regressors
from compd.diagnosis.rivals import collinearity, find_rivals, simplify
from compd.diagnosis.subset_search import Subset, SubsetSearch
from compd.model.library import load_library

ROWS = 240
LIBRARY = load_library()
ORDINARY, CONTRADICTING = LIBRARY["link_expansion"], LIBRARY["reference_registration"]


def columns(seed: int, count: int = 1) -> FloatArray:
    """(ROWS, 3, count) unit noise."""
    return np.random.default_rng(seed).standard_normal((ROWS, 3, count))


def search(y: FloatArray, values: Mapping[str, FloatArray], **changed: Candidate) -> SubsetSearch:
    """A search on a residual (ROWS, 3), whitened, split into 4 sessions and 5 sectors.

    values : columns by the candidate's name; ranges are -100 to 100.  changed : other candidates in their place.
    """
    rows = np.arange(ROWS)
    splits = (rows * 4 // ROWS, np.random.default_rng(99).integers(0, 5, ROWS))
    nuisance = Regressors(np.zeros((ROWS, 3, 0)), np.zeros(0))
    data = RegressionData(y, splits, rows * 24 // ROWS, nuisance)
    candidates = [changed.get(name, candidate(name, array)) for name, array in values.items()]
    return SubsetSearch(data, candidates, list(values.values()), Criteria())


def candidate(name: str, array: FloatArray, limit: float = 100.0) -> Candidate:
    limits = np.tile([-limit, limit], (array.shape[2], 1))
    return Candidate(name, ORDINARY, array, limits, 0)


def test_the_columns_in_the_residual_are_selected() -> None:
    a, b, c = columns(1), columns(2), columns(3, 3)
    y = columns(4)[:, :, 0] + 2.0 * a[:, :, 0] - 1.5 * b[:, :, 0]
    subset_search = search(y, {"a": a, "b": b, "c": c})
    assert set(subset_search.best_subset().members) == {0, 1}
    (theta_a, covariance), _ = subset_search.estimates((0, 1))
    assert theta_a[0] == pytest.approx(2.0, abs=4 * np.sqrt(covariance[0, 0]))
    assert subset_search.baseline == pytest.approx(np.mean(y**2), rel=1e-6)


def test_noise_alone_selects_nothing() -> None:
    subset_search = search(columns(5)[:, :, 0], {"a": columns(6), "b": columns(7, 4)})
    assert subset_search.best_subset() == Subset((), subset_search.baseline)


def test_what_needs_an_implausible_parameter_is_not_selected() -> None:
    a = columns(1)
    y = columns(4)[:, :, 0] + 2.0 * a[:, :, 0]
    assert search(y, {"a": a}).best_subset().members == (0,)
    assert search(y, {"a": a}, a=candidate("a", a, limit=0.1)).best_subset().members == ()


def test_descriptions_and_contradictions_of_the_sidecar_must_gain_more() -> None:
    a = columns(1)
    criteria = Criteria()
    empirical = candidate("a", a, limit=np.inf)
    contradicting = replace(candidate("a", a), effect=CONTRADICTING)
    assert candidate("a", a).penalty_factor(criteria) == 1.0
    assert empirical.penalty_factor(criteria) == criteria.description_factor
    assert contradicting.penalty_factor(criteria) == criteria.contradiction_factor
    y = columns(4)[:, :, 0] + 0.6 * a[:, :, 0]  # gains about 0.36: more than 0.2, less than 0.5
    assert search(y, {"a": a}).best_subset().members == (0,)
    assert search(y, {"a": a}, a=empirical).best_subset().members == ()


def test_a_nearly_equal_column_is_a_rival_and_another_is_not() -> None:
    a, other = columns(1), columns(3)
    twin = a + 0.05 * columns(2)
    y = columns(4)[:, :, 0] + 1.5 * a[:, :, 0]
    subset_search = search(y, {"a": a, "twin": twin, "other": other})
    (rival,) = find_rivals(subset_search, (0,), 0)
    assert rival.name == "twin"
    assert rival.cosine == pytest.approx(1 / np.hypot(1.0, 0.05), abs=1e-3)
    assert collinearity(subset_search, (0,), 0, 2) < 0.2


def test_collinearity_is_that_beside_the_rest_of_the_subset() -> None:
    a, b = columns(1), columns(2)
    y = columns(4)[:, :, 0] + 1.5 * a[:, :, 0] + 2.0 * b[:, :, 0]
    subset_search = search(y, {"a": a, "b": b, "a and b": a + b})
    assert collinearity(subset_search, (0,), 0, 2) == pytest.approx(1 / np.sqrt(2), abs=0.1)
    assert collinearity(subset_search, (0, 1), 0, 2) == pytest.approx(1.0)


def test_the_one_with_fewer_parameters_is_preferred_where_both_do_as_well() -> None:
    a = columns(1)
    general = np.concatenate([a, columns(2, 2)], axis=2)
    y = columns(4)[:, :, 0] + 1.5 * a[:, :, 0]
    subset_search = search(y, {"general": general, "a": a})
    (subset,) = subset_search.evaluate([(0,)])
    assert simplify(subset_search, subset).members == (1,)
    (simple,) = subset_search.evaluate([(1,)])
    assert simplify(subset_search, simple).members == (1,)


def test_excess_loss_is_the_difference_of_cross_validated_losses() -> None:
    a, b = columns(1), columns(2)
    y = columns(4)[:, :, 0] + 1.5 * a[:, :, 0]
    subset_search = search(y, {"a": a, "b": b})
    excess, std = subset_search.excess_loss((1,), than=(0,))
    loss_a, loss_b = (subset.cv_loss for subset in subset_search.evaluate([(0,), (1,)]))
    assert excess == pytest.approx(loss_b - loss_a, rel=1e-6)
    assert 0 < std < excess
