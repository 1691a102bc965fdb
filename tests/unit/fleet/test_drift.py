"""Drifts: a line that is no chance is named, scatter and few campaigns are not."""

from __future__ import annotations

import numpy as np
import pytest

from compd.fleet.drift import drifts
from tests.support.fleets import machine, result

WEEK = 7.0


def test_a_steady_change_is_named_with_its_slope() -> None:
    (drift,) = drifts(machine("tripod-01", [1.0, 1.1, 1.2, 1.3], 0.02))
    assert drift.named
    assert drift.slope == pytest.approx(0.1 / WEEK)
    assert drift.change == pytest.approx(0.3)
    # of four values a week apart: sigma / sqrt(sum (t - mean)^2)
    assert drift.slope_std == pytest.approx(0.02 / (WEEK * np.sqrt(5.0)))
    assert drift.intercept == pytest.approx(1.0)


def test_weights_are_the_standard_errors() -> None:
    results = [*machine("tripod-01", [1.0, 1.1, 1.2], 0.01), *machine("tripod-01", [9.0], 1e6)]
    results[-1] = result("tripod-01", 9, results[-1].estimates)
    (drift,) = drifts(results)
    assert drift.slope == pytest.approx(0.1 / WEEK, rel=1e-6)


def test_what_stays_the_same_is_not_named() -> None:
    chance = np.random.default_rng(4)
    fleet = [campaign for k in range(40) for campaign in machine(f"m{k:02d}", 1 + 0.02 * chance.standard_normal(8))]
    assert [drift.machine for drift in drifts(fleet) if drift.named] == []


def test_scatter_beyond_the_standard_errors_counts() -> None:
    # beside standard errors of 0.001 each of these slopes would be hundreds of them
    (drift,) = drifts(machine("tripod-01", [1.0, 1.3, 0.9, 1.2, 1.1], 0.001))
    assert not drift.named
    assert drift.slope_std > 0.001


@pytest.mark.parametrize("scatter", [1.5, 3.0])
def test_standard_errors_that_are_too_small_on_all_machines_name_nothing(scatter: float) -> None:
    chance = np.random.default_rng(5)
    fleet = [
        campaign
        for k in range(20)
        for campaign in machine(f"m{k:02d}", 1 + scatter * 0.02 * chance.standard_normal(5), 0.02)
    ]
    assert [drift.machine for drift in drifts(fleet) if drift.named] == []
    steady = machine("steady", 1 + scatter * np.linspace(0, 1, 5), 0.02)
    assert [drift.machine for drift in drifts([*fleet, *steady]) if drift.named] == ["steady"]


def test_two_campaigns_and_unknown_errors_have_no_line() -> None:
    (drift,) = drifts(machine("tripod-01", [1.0, 2.0], 0.02))
    assert not drift.named
    assert np.isnan(drift.slope)
    (drift,) = drifts(machine("tripod-01", [1.0, 2.0, 3.0], float("nan")))
    assert np.isnan(drift.p_value)


def test_without_times_campaigns_are_counted() -> None:
    (drift,) = drifts(machine("tripod-01", [1.0, 1.1, 1.2, 1.3], 0.02, started_at=None))
    assert drift.time.tolist() == [1, 2, 3, 4]
    assert drift.started_at == ()
    assert drift.slope == pytest.approx(0.1)


def test_machines_are_apart_and_failures_do_not_count() -> None:
    fleet = [*machine("a", [1.0, 1.0]), *machine("b", [2.0]), result("b", 5, problem="cannot be read")]
    assert [(drift.machine, len(drift.time)) for drift in drifts(fleet)] == [("a", 2), ("b", 1)]
