"""Warm-up: settles where it must, never overshoots, does not depend on how time is cut up."""

from __future__ import annotations

import numpy as np
import pytest

from compd.simulation.truth.heat import HeatNetwork
from compd.simulation.truth.strengths import Strengths
from compd.simulation.truth.warm_up import WarmUp
from compd.simulation.truth.weather import REFERENCE_degC, Weather

STEADY_AFTER_S = 30 * 86400.0


def warm_up(swing_K: float = 0.0, heat_share: float = 1.0) -> WarmUp:
    return WarmUp(3, Weather(swing_K, np.random.default_rng(5)), heat_share)


def test_one_body_follows_the_textbook_exponential() -> None:
    network = HeatNetwork({"block": 1000.0}, {"block": 0.5}, [], 20.0)
    network.advance(2000.0, 25.0, np.zeros(1))  # one time constant
    assert network.temperature_degC[0] == pytest.approx(25.0 - 5.0 * np.exp(-1.0), abs=1e-9)


def test_two_bodies_share_their_heat_and_keep_it_all() -> None:
    network = HeatNetwork({"warm": 300.0, "cold": 100.0}, {"cold": 1e-9}, [("warm", "cold", 2.0)], 20.0)
    network.temperature_degC = np.array([24.0, 20.0])
    network.advance(1e4, 20.0, np.zeros(2))
    assert network.temperature_degC == pytest.approx([23.0, 23.0], abs=1e-4)


def test_steady_state_lets_out_what_the_drives_put_in() -> None:
    network = HeatNetwork({"a": 500.0, "b": 700.0}, {"a": 0.2, "b": 0.6}, [("a", "b", 0.3)], 20.0)
    heat_W = np.array([3.0, 0.0])
    network.advance(1e6, 20.0, heat_W)
    assert network.temperature_degC == pytest.approx(network.steady_degC(20.0, heat_W), abs=1e-9)
    assert ((network.temperature_degC - 20.0) * [0.2, 0.6]).sum() == pytest.approx(heat_W.sum(), abs=1e-9)


@pytest.mark.long
def test_warm_up_rises_without_overshoot() -> None:
    warm = warm_up()
    before = dict.fromkeys(warm.thermometers_degC(), REFERENCE_degC)
    for _ in range(60):
        warm.advance(600.0, 1.0)
        now = warm.thermometers_degC()
        assert all(now[name] >= before[name] - 1e-9 for name in now)
        before = now
    settled = warm_up()
    settled.advance(STEADY_AFTER_S, 1.0)
    top = settled.thermometers_degC()
    assert all(before[name] <= top[name] + 1e-9 for name in top)
    assert 0.2 < top["temperature_link_1_degC"] - REFERENCE_degC < 5.0
    assert 0.2 < top["temperature_frame_degC"] - REFERENCE_degC < 5.0


@pytest.mark.parametrize("step_s", [0.02, 1.0, 8.0, 300.0])
def test_step_does_not_matter(step_s: float) -> None:
    coarse, fine = warm_up(swing_K=1.0), warm_up(swing_K=1.0)
    coarse.advance(600.0, 0.5)
    for _ in range(round(600.0 / step_s)):
        fine.advance(step_s, 0.5)
    assert fine.time_s == pytest.approx(coarse.time_s)
    first, second = coarse.thermometers_degC(), fine.thermometers_degC()
    assert all(first[name] == pytest.approx(second[name], abs=1e-4) for name in first)


def test_switched_off_in_a_steady_room_nothing_changes() -> None:
    warm = warm_up(heat_share=0.0)
    warm.advance(86400.0, 1.0)
    assert all(value == pytest.approx(REFERENCE_degC, abs=1e-9) for value in warm.thermometers_degC().values())


def test_room_starts_at_reference_and_stays_in_its_swing() -> None:
    weather = Weather(Strengths().room_swing_K, np.random.default_rng(2))
    assert weather.room_degC(0.0) == REFERENCE_degC
    day = [weather.room_degC(time_s) for time_s in range(0, 2 * 86400, 100)]
    assert 1.0 < max(day) - min(day) < 3.0
