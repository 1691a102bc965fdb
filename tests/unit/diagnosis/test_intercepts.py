"""An effect that grows with a quantity is named with its intercept, on columns of noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from compd.arrays import FloatArray
from compd.diagnosis import Candidate, SubsetLosses
from compd.diagnosis.intercepts import beside, with_intercepts
from compd.model.library import load_library
from tests.support.candidate_sets import candidate, columns, noise, subset_losses

SLOPE, ZERO, MORE = columns(1), columns(2), columns(3, 3)
s, z, m = SLOPE[:, :, 0], ZERO[:, :, 0], MORE[:, :, 0]
GAIN = replace(load_library()["link_expansion"], intercept="zero")
# Places of the candidates: a gain, what holds its intercept as a special case, and the intercept.
SLOPE_AT, JOINTS_AT, ZERO_AT = 0, 1, 2


def candidates(limit: float = 100.0) -> list[Candidate]:
    joints = candidate("joints", np.concatenate([ZERO, MORE], axis=2))
    return [candidate("slope", SLOPE, effect=GAIN), joints, candidate("zero", ZERO, limit)]


def losses(y: FloatArray, limit: float = 100.0, least_loss: float = 0.0) -> SubsetLosses:
    return subset_losses(y, candidates(limit), least_loss=least_loss)


def test_the_library_names_the_intercept_of_a_gain() -> None:
    assert load_library()["scale_gain"].intercept == "link_zero"
    assert {effect.intercept for effect in load_library().values()} <= {"", *load_library()}


def test_an_intercept_that_an_effect_with_more_numbers_took_along_is_named_before_it() -> None:
    found = losses(noise(4) + 2.0 * s + 1.5 * z + 1.5 * m)
    assert with_intercepts(found, (SLOPE_AT, JOINTS_AT)) == (SLOPE_AT, ZERO_AT, JOINTS_AT)


def test_without_an_intercept_none_is_named() -> None:
    found = losses(noise(4) + 2.0 * s + 1.5 * m)
    assert with_intercepts(found, (SLOPE_AT, JOINTS_AT)) == (SLOPE_AT, JOINTS_AT)


def test_an_effect_that_is_not_worth_its_price_beside_the_intercept_took_nothing_along() -> None:
    found = losses(noise(4) + 2.0 * s + 1.5 * z + 0.05 * m)
    assert with_intercepts(found, (SLOPE_AT, JOINTS_AT)) == (SLOPE_AT, JOINTS_AT)


def test_no_intercept_belongs_to_what_is_no_slope() -> None:
    found = losses(noise(4) + 2.0 * s + 1.5 * z + 1.5 * m)
    assert with_intercepts(found, (JOINTS_AT,)) == (JOINTS_AT,)


def test_an_implausible_intercept_is_not_named() -> None:
    """Its only number is held to a range that it does not reach."""
    found = losses(noise(4) + 2.0 * s + 1.5 * z + 1.5 * m, limit=1e-3)
    assert with_intercepts(found, (SLOPE_AT, JOINTS_AT)) == (SLOPE_AT, JOINTS_AT)


def test_at_the_floor_nothing_more_is_looked_for() -> None:
    y = noise(4) + 2.0 * s + 1.5 * z + 1.5 * m
    assert with_intercepts(losses(y, least_loss=1.0), (SLOPE_AT, JOINTS_AT)) == (SLOPE_AT, JOINTS_AT)
    above = losses(2.0 * y, least_loss=1.0)
    assert with_intercepts(above, (SLOPE_AT, JOINTS_AT)) == (SLOPE_AT, ZERO_AT, JOINTS_AT)


def test_an_intercept_is_judged_beside_what_cannot_contain_it() -> None:
    found = losses(noise(4) + 2.0 * s + 1.5 * z + 1.5 * m)
    members = (SLOPE_AT, ZERO_AT, JOINTS_AT)
    assert beside(found, members, ZERO_AT) == (SLOPE_AT,)
    assert beside(found, members, JOINTS_AT) == (SLOPE_AT, ZERO_AT)
    assert beside(found, (ZERO_AT, JOINTS_AT), ZERO_AT) == (JOINTS_AT,)
