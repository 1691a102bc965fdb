"""A correction's limits, as properties."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from compd.live.loop.limits import limit_correction
from compd.operation_settings import LimitSettings
from compd.setpoint_states import State

MAX_MM = 0.2
SLEW_MM_PER_S = 0.5
PERIOD_S = 0.005
STEP_MM = SLEW_MM_PER_S * PERIOD_S
ROUNDING_MM = 1e-11

CLAMP = LimitSettings(correction_mm=MAX_MM, slew_mm_per_s=SLEW_MM_PER_S, on_limit="clamp")
REFUSE = LimitSettings(correction_mm=MAX_MM, slew_mm_per_s=SLEW_MM_PER_S, on_limit="refuse")

any_wanted = st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=3, max_size=3)
within = st.lists(st.floats(-MAX_MM, MAX_MM), min_size=3, max_size=3)


@given(wanted=any_wanted, previous=within, limits=st.sampled_from([CLAMP, REFUSE]))
def test_whatever_is_wanted_the_applied_correction_keeps_both_limits(wanted, previous, limits):
    result = limit_correction(np.array(wanted), np.array(previous), PERIOD_S, limits)
    assert np.all(np.abs(result.applied_mm) <= MAX_MM + ROUNDING_MM)
    assert np.all(np.abs(result.applied_mm - previous) <= STEP_MM + ROUNDING_MM)
    assert (result.state is State.OK) == (result.reason == "")


@given(wanted=any_wanted, previous=within, limits=st.sampled_from([CLAMP, REFUSE]))
def test_ok_means_untouched_and_anything_else_is_named(wanted, previous, limits):
    result = limit_correction(np.array(wanted), np.array(previous), PERIOD_S, limits)
    if result.state is State.OK:
        assert result.applied_mm.tolist() == wanted
    else:
        assert result.reason.startswith("link ")


@given(wanted=within)
def test_a_constant_wish_is_reached_and_never_overshot(wanted):
    applied = np.zeros(3)
    for _ in range(math.ceil(MAX_MM / STEP_MM) + 1):
        result = limit_correction(np.array(wanted), applied, PERIOD_S, CLAMP)
        assert np.all(np.abs(result.applied_mm) <= np.abs(wanted) + ROUNDING_MM)
        applied = result.applied_mm
    assert applied == pytest.approx(np.array(wanted), abs=ROUNDING_MM)
    assert result.state is State.OK


def test_the_first_correction_starts_from_zero():
    result = limit_correction(np.array([0.05, 0.0, -0.05]), np.zeros(3), PERIOD_S, CLAMP)
    assert result.state is State.SLEWING
    assert result.applied_mm == pytest.approx([STEP_MM, 0.0, -STEP_MM])
    assert result.reason == "link 1: correction 0.0500 mm wanted, 0.0025 mm reached at 0.5 mm/s"


def test_a_clamped_correction_says_link_wanted_and_allowed():
    previous = np.array([0.0, MAX_MM, 0.0])
    result = limit_correction(np.array([0.0, 0.312, 0.0]), previous, PERIOD_S, CLAMP)
    assert result.state is State.CLAMPED
    assert result.applied_mm.tolist() == previous.tolist()
    assert result.reason == "link 2: correction 0.312 mm beyond 0.200 mm, clamped"


def test_a_refused_correction_keeps_the_previous_one_and_says_why():
    previous = np.array([0.01, 0.02, 0.03])
    result = limit_correction(np.array([0.01, 0.02, -0.5]), previous, PERIOD_S, REFUSE)
    assert result.state is State.REFUSED
    assert result.applied_mm is previous
    assert result.reason == "link 3: correction -0.500 mm beyond -0.200 mm, refused"


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("limits", [CLAMP, REFUSE])
def test_what_is_not_finite_is_refused_even_where_clamping_is_wanted(bad, limits):
    previous = np.array([0.01, 0.02, 0.03])
    result = limit_correction(np.array([0.01, bad, 0.03]), previous, PERIOD_S, limits)
    assert result.state is State.REFUSED
    assert result.applied_mm is previous
    assert "link 2" in result.reason
    assert "not finite" in result.reason


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("above_mm", "state"), [(5e-13, State.OK), (1e-9, State.CLAMPED)])
def test_what_is_beyond_the_limit_by_rounding_alone_is_not_clamped(sign, above_mm, state):
    wanted = np.array([0.0, sign * (MAX_MM + above_mm), 0.0])
    assert limit_correction(wanted, wanted, PERIOD_S, CLAMP).state is state
