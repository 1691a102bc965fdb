"""Which parameters are plausible: inside their range, or weaker than usual, but never of the other sign."""

from __future__ import annotations

import numpy as np
import pytest

from compd.diagnosis.candidates.plausibility import estimate_parameters, is_plausible, is_undetermined
from compd.diagnosis.criteria import Criteria
from compd.model.library import load_library

CRITERIA = Criteria(range_sigmas=3.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_range_on_one_side_of_zero_gives_the_sign(sign: float) -> None:
    low, high = sorted((sign * 0.5, sign * 200.0))
    assert is_plausible((low, high), sign * 0.1, 0.0, CRITERIA), "weaker than usual"
    assert not is_plausible((low, high), sign * -18.0, 0.1, CRITERIA)
    assert is_plausible((low, high), sign * -0.1, 0.04, CRITERIA), "within three standard errors of nothing"
    assert not is_plausible((low, high), sign * -0.1, float("nan"), CRITERIA)


def test_a_range_may_be_exceeded_by_a_share_of_it_or_by_three_standard_errors() -> None:
    assert is_plausible((0.0, 1.0), 0.99 + CRITERIA.range_slack, 0.0, CRITERIA)
    assert not is_plausible((0.0, 1.0), 1.01 + CRITERIA.range_slack, 0.0, CRITERIA)
    assert is_plausible((0.0, 1.0), 1.5, 0.2, CRITERIA)
    assert not is_plausible((0.0, 1.0), 1.5, 0.1, CRITERIA)
    assert is_plausible((-1.0, 1.0), -0.99 - 2 * CRITERIA.range_slack, float("nan"), CRITERIA)


def test_parameters_are_undetermined_unless_one_is_known_better_than_its_range() -> None:
    limits = np.array([[0.0, 1.0], [0.0, 1.0]])
    assert is_undetermined(limits, np.array([2.0, np.nan]))
    assert not is_undetermined(limits, np.array([2.0, 0.5]))


def test_estimates_are_in_the_units_that_people_read() -> None:
    """Stiffness is fitted as compliance."""
    effect = load_library()["link_elasticity"]
    (number,) = estimate_parameters(effect, 3, np.array([1 / 30]), np.array([[1e-6]]), CRITERIA)
    assert (number.name, number.unit, number.plausible) == ("k", "N/um", True)
    assert number.value == pytest.approx(30.0)
    assert number.std == pytest.approx(30.0**2 * 1e-3, rel=0.01)
    (unknown,) = estimate_parameters(effect, 3, np.array([1 / 30]), np.zeros((0, 0)), CRITERIA)
    assert np.isnan(unknown.std)
