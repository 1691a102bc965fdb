"""Effects that remember: hysteresis by distance, lag by time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from compd.model.kinematics import Movement
from tests.support.effect_rows import TRIPOD, delta_mm, rows_at_tips
from tests.support.model_machines import Floats

UM = 1e-3
LINK_MM = 481.040538832228  # the tripod's links at machine zero


def along(position_mm: Floats, rounded: float = 0.0) -> Floats:
    """Bend of link 1 in um, one micrometre when sliding, yield after 2 mm of travel."""
    scale_mm = np.repeat(np.asarray(position_mm)[:, None], 3, axis=1)
    count = len(scale_mm)
    unknown = Movement(np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 9)))
    tip = np.tile(TRIPOD.zero.contact.tip_M_mm, (count, 1))
    rows = rows_at_tips(TRIPOD, tip, scale_mm=scale_mm, movement=unknown)
    return -delta_mm("friction_hysteresis", rows, 1.0, d=2.0, r=rounded)[:, 0] / UM


def test_hysteresis_builds_up_again_after_a_reversal() -> None:
    np.testing.assert_allclose(along(np.array([0, 1, 2, 5, 4, 3, 1, 0, 1])), [0, 0.5, 1, 1, 0.5, 0, -1, -1, -0.5])


def test_a_small_loop_within_the_yield_distance_closes_on_itself() -> None:
    found = along(np.array([0, 10, 9, 10, 9.5, 10, 6, 7, 6]))
    np.testing.assert_allclose(found[[1, 3, 5]], 1.0)
    np.testing.assert_allclose(found[[6, 8]], -1.0)


def test_hysteresis_follows_the_approach_where_rows_hide_a_reversal() -> None:
    """Both rows are approached from above: between them the link went farther down than the second."""
    scale_mm = np.array([[10.0] * 3, [0.0] * 3])
    upwards = Movement(np.ones((2, 3)), np.zeros((2, 3)), np.zeros((2, 9)))
    rows = rows_at_tips(TRIPOD, np.tile(TRIPOD.zero.contact.tip_M_mm, (2, 1)), scale_mm=scale_mm, movement=upwards)
    np.testing.assert_allclose(delta_mm("friction_hysteresis", rows, 1.0, d=2.0, r=0.0), -UM)


def test_a_round_loop_nears_its_end_by_a_factor_e_over_the_distance() -> None:
    """dz/dg = (s - z) s / d: exact, however the way is divided into rows."""
    for steps in (1, 7):
        scale_mm = np.concatenate([[0.0], np.linspace(0, 40, 9)[1:], 40 - np.linspace(0, 2, steps + 1)[1:]])
        bend = along(scale_mm, rounded=1.0)
        assert bend[8] == pytest.approx(1.0, abs=1e-8)
        assert bend[-1] == pytest.approx(-1 + 2 * np.exp(-1), abs=1e-7)


def test_a_session_forgets_the_one_before() -> None:
    scale_mm = np.repeat([[0.0], [10.0], [10.0]], 3, axis=1)
    unknown = Movement(np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 9)))
    rows = rows_at_tips(
        TRIPOD,
        np.tile(TRIPOD.zero.contact.tip_M_mm, (3, 1)),
        scale_mm=scale_mm,
        movement=unknown,
        session_start=np.array([True, False, True]),
    )
    np.testing.assert_allclose(delta_mm("friction_hysteresis", rows, 1.0, d=2.0, r=0.0)[:, 0], [0, -UM, 0], atol=1e-15)


def step_response(times_s: Floats, tau_s: float) -> Floats:
    """Warming of the rod in K: the skin steps by 1 K just after the start."""
    warm = np.where(np.arange(len(times_s)) == 0, 20.0, 21.0)
    tip = np.tile(TRIPOD.zero.contact.tip_M_mm, (len(times_s), 1))
    rows = rows_at_tips(TRIPOD, tip, {f"temperature_link_{i}_degC": warm for i in (1, 2, 3)}, time_s=times_s)
    found = delta_mm("link_expansion_lag", rows, 10.0, tau=tau_s)[:, 0]
    return found / (10e-6 * LINK_MM)


def test_a_step_of_temperature_arrives_exponentially() -> None:
    times_s = np.array([0.0, 1e-6, 100.0, 700.0, 701.0, 5000.0])
    np.testing.assert_allclose(step_response(times_s, 600.0)[1:], 1 - np.exp(-times_s[1:] / 600), atol=1e-8)


def test_the_lag_does_not_depend_on_how_often_it_is_asked() -> None:
    coarse = np.array([0.0, 1e-6, 1200.0])
    fine = np.concatenate([[0.0, 1e-6], np.linspace(1.0, 1200.0, 4000)])
    assert step_response(coarse, 600.0)[-1] == pytest.approx(step_response(fine, 600.0)[-1], abs=1e-12)


def test_the_lag_solves_its_differential_equation_for_a_ramping_room() -> None:
    rng = np.random.default_rng(1)
    times_s = np.cumsum(rng.uniform(5, 400, 30))
    skin_K = np.cumsum(rng.normal(0, 0.2, 30))
    tip = np.tile(TRIPOD.zero.contact.tip_M_mm, (30, 1))
    rows = rows_at_tips(TRIPOD, tip, {f"temperature_link_{i}_degC": 20 + skin_K for i in (1, 2, 3)}, time_s=times_s)
    found = delta_mm("link_expansion_lag", rows, 1.0, tau=900.0)[:, 0] / (1e-6 * LINK_MM)
    solution = solve_ivp(
        lambda t, y: (np.interp(t, times_s, skin_K) - y) / 900.0,
        (times_s[0], times_s[-1]),
        skin_K[:1],
        t_eval=times_s,
        rtol=1e-9,
        atol=1e-9,
        max_step=2.0,
    )
    np.testing.assert_allclose(found, solution.y[0], atol=1e-6)


def test_a_missing_temperature_leaves_no_trace_in_the_lag() -> None:
    warm = np.array([20.0, 21.0, np.nan, 21.0, 21.0])
    tip = np.tile(TRIPOD.zero.contact.tip_M_mm, (5, 1))
    times_s = np.array([0.0, 1e-6, 300.0, 600.0, 900.0])
    rows = rows_at_tips(TRIPOD, tip, {f"temperature_link_{i}_degC": warm for i in (1, 2, 3)}, time_s=times_s)
    found = delta_mm("link_expansion_lag", rows, 10.0, tau=600.0)[:, 0] / (10e-6 * LINK_MM)
    assert np.isnan(found[2])
    np.testing.assert_allclose(found[[3, 4]], step_response(times_s, 600.0)[[3, 4]], atol=1e-12)
