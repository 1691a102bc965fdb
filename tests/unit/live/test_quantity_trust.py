"""Temperatures that an effect reads are believed as lengths are: what a broken thermometer does to the tip."""

from __future__ import annotations

import math

import numpy as np
import pytest

from compd.gauge import Quality, good
from compd.live.acquisition.cross_checks.cross_checks import StandingTemperature
from compd.live.acquisition.cross_checks.machine_view import MachineView
from compd.live.acquisition.quantity_bounds import quantity_limits
from compd.live.acquisition.quantity_trust import QuantityTrust
from compd.live.memory.trust_memory import Doubt, TrustMemory
from compd.operation_settings import QuantityWire, VoteSettings
from compd.setpoint_states import State
from compd.units import unit_of
from tests.support.thermometers import warm_machine

MACHINES = ("tripod-cmm.yaml", "hexapod.yaml")
CHANNEL = "cabinet.link_1"
NAME = "temperature_link_1_degC"


def at_rest(name, tmp_path):
    live = warm_machine(name, tmp_path)
    live.run(0.5)
    assert live.step().state is State.OK
    return live


@pytest.fixture(params=MACHINES)
def each(request, tmp_path):
    return at_rest(request.param, tmp_path)


@pytest.fixture
def warm(tmp_path):
    return at_rest("tripod-cmm.yaml", tmp_path)


def worst_um(live, setpoints, right_mm) -> float:
    """Largest distance of a valid tip from the right one."""
    valid = [setpoint.values.tip_M_mm for setpoint in setpoints if setpoint.values is not None]
    return max(float(np.linalg.norm(tip_mm - right_mm)) for tip_mm in valid) * 1e3


def reading(live):
    return live.latest.snapshot(live.now_s).readings[live.latest.index[CHANNEL]]


@pytest.mark.parametrize("shown", [327.67, 60.0, 0.0, 28.0], ids=lambda shown: f"{shown:g} degC")
def test_a_thermometer_that_breaks_moves_no_tip_and_is_not_believed(each, shown):
    warm = each
    right_mm = warm.step().values.tip_M_mm
    warm.cabinet.shows["link_1"] = lambda _: shown
    setpoints = warm.run(3.0)
    assert worst_um(warm, setpoints, right_mm) < 1.0
    assert setpoints[-1].state is State.FAULT
    assert f"{NAME} ({CHANNEL}): distrusted" in setpoints[-1].reason
    assert f"look at it, then `compd accept {CHANNEL}`" in reading(warm).detail


@pytest.mark.parametrize("wrong", [[304.67], [5.0], [-23.0] * 20])
def test_a_few_wild_readings_do_nothing(each, wrong):
    warm = each
    right_mm = warm.step().values.tip_M_mm
    warm.cabinet.damage["link_1"] = list(wrong)
    setpoints = warm.run(1.5)
    assert worst_um(warm, setpoints, right_mm) < 1.0
    assert {setpoint.state for setpoint in setpoints} <= {State.OK, State.HOLD}
    assert setpoints[-1].state is State.OK


def test_noise_moves_the_tip_by_what_is_no_noise_and_is_found(each):
    warm = each
    right_mm = warm.step().values.tip_M_mm
    warm.cabinet.noise_K["link_1"] = 1.0
    setpoints = warm.run(5.0)
    assert worst_um(warm, setpoints, right_mm) < 0.5
    assert setpoints[-1].state is State.FAULT


def test_a_ramp_that_no_heat_makes_is_found(each):
    warm = each
    right_mm = warm.step().values.tip_M_mm
    start_s = warm.now_s
    warm.cabinet.shows["link_1"] = lambda time_s: 23.0 + min(time_s - start_s, 3.0)
    setpoints = warm.run(4.0)
    assert worst_um(warm, setpoints, right_mm) < 4.0
    assert setpoints[-1].state is State.FAULT


def test_parts_that_grow_warm_are_followed(warm):
    start_s = warm.now_s
    for name in warm.cabinet.shows:
        warm.cabinet.shows[name] = lambda time_s: 23.0 + 0.15 * (time_s - start_s)
    setpoints = warm.run(10.0)
    assert {setpoint.state for setpoint in setpoints} <= {State.OK, State.SLEWING}
    assert reading(warm).value == pytest.approx(24.5, abs=0.1)


def test_a_person_accepts_a_thermometer_as_a_length(warm):
    warm.cabinet.shows["link_1"] = lambda _: 28.0
    warm.run(2.0)
    assert reading(warm).quality is Quality.DISTRUSTED
    warm.cabinet.shows["link_1"] = lambda _: 23.5
    warm.run(1.0)
    assert reading(warm).quality is Quality.DISTRUSTED, "not by itself"
    assert warm.memory.accept(CHANNEL) == [CHANNEL]
    warm.run(1.0)
    assert reading(warm).ok
    assert warm.step().state is State.OK


@pytest.mark.parametrize("shown", [327.67, 60.0, 0.0, 28.0, 22.0], ids=lambda shown: f"{shown:g} degC")
@pytest.mark.parametrize("is_restarted", [False, True])
def test_a_thermometer_that_is_right_again_is_believed_by_itself(each, shown, is_restarted):
    right_mm = each.step().values.tip_M_mm
    each.cabinet.shows["link_1"] = lambda _: shown
    each.run(4.0)
    assert reading(each).quality is Quality.DISTRUSTED
    if is_restarted:
        each.start_acquisition()
    each.cabinet.shows["link_1"] = lambda _: 23.0
    setpoints = each.run(2.0)
    assert setpoints[-1].state is State.OK
    assert worst_um(each, setpoints, right_mm) < 1.0


@pytest.mark.parametrize("away_K", [5.0, 1.0, -0.8])
def test_time_alone_makes_no_wrong_thermometer_right(warm, away_K):
    """Whatever the room does meanwhile: as far as a thermometer usually drifts in an hour."""
    warm.cabinet.shows["link_1"] = lambda _: 23.0 + away_K
    warm.run(2.0)
    assert reading(warm).quality is Quality.DISTRUSTED
    warm.now_s += 3600.0
    warm.run(5.0)
    assert reading(warm).quality is Quality.DISTRUSTED


def test_a_thermometer_that_was_wrong_for_an_hour_is_believed_where_it_can_have_drifted_to(warm):
    warm.cabinet.shows["link_1"] = lambda _: 60.0
    warm.run(2.0)
    warm.now_s += 3600.0
    warm.cabinet.shows["link_1"] = lambda _: 25.0
    warm.run(2.0)
    assert reading(warm).value == pytest.approx(25.0, abs=0.1)


def test_a_thermometer_that_is_right_for_a_moment_is_still_not_believed(warm):
    start_s = warm.now_s
    warm.cabinet.shows["link_1"] = lambda time_s: (
        23.0 if (time_s - start_s) % 1.0 < 0.5 and time_s > start_s + 3 else 60.0
    )
    warm.run(10.0)
    assert reading(warm).quality is Quality.DISTRUSTED


def test_one_that_is_still_broken_is_not_believed_though_it_is_accepted(warm):
    warm.cabinet.shows["link_1"] = lambda _: 327.67
    warm.run(2.0)
    warm.memory.accept("all")
    warm.run(0.1)
    assert warm.memory.doubt[warm.memory.index[CHANNEL]] == Doubt.IMPLAUSIBLE
    assert "degC, which is not plausible" in reading(warm).detail


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("shown", [327.67, 60.0, 0.0])
def test_one_that_is_broken_when_the_daemon_starts_is_never_used(name, shown, tmp_path):
    live = warm_machine(name, tmp_path)
    live.cabinet.shows["link_1"] = lambda _: shown
    setpoints = live.run(3.0)
    assert all(setpoint.values is None for setpoint in setpoints)
    assert reading(live).quality is Quality.DISTRUSTED


@pytest.mark.parametrize("name", MACHINES)
def test_what_is_not_believed_outlives_the_process_that_polls(name, tmp_path):
    live = warm_machine(name, tmp_path)
    live.run(1.0)
    live.start_acquisition()
    live.cabinet.shows["link_1"] = lambda _: 28.0
    live.run(2.0)
    live.start_acquisition()
    live.run(1.0)
    assert "jumped by" in reading(live).detail


def test_after_a_long_silence_it_may_have_changed(warm):
    warm.now_s += 60.0
    for name in warm.cabinet.shows:
        warm.cabinet.shows[name] = lambda _: 28.0
    warm.run(0.5)
    assert reading(warm).value == pytest.approx(28.0, abs=0.1)


def test_the_healthy_ones_are_not_named_where_one_of_three_is_broken(tmp_path):
    limits = quantity_limits(QuantityWire(name=NAME, gauge=CHANNEL))
    live = warm_machine("tripod-cmm.yaml", tmp_path, fastest_change=1e6)
    live.run(1.0)
    for name in live.cabinet.shows:
        live.cabinet.shows[name] = lambda _: 23.0 + limits.apart + 1.0
    live.cabinet.shows["link_1"] = lambda _: 23.0
    live.run(3.0)
    doubted = [c for c in live.memory.channels if live.memory.doubt[live.memory.index[c]] != Doubt.NONE]
    assert doubted == [CHANNEL]
    assert "from its neighbours" in reading(live).detail


@pytest.mark.parametrize(
    ("name", "key", "value", "limit"),
    [
        ("temperature_room_degC", {}, "high", 50.0),
        ("temperature_spindle_degC", {"plausible": (10, 90)}, "high", 90.0),
        ("temperature_spindle_degC", {}, "fastest_per_s", 0.2),
        ("temperature_spindle_degC", {"fastest_change": 3.0}, "fastest_per_s", 3.0),
        ("temperature_spindle_degC", {"apart": 50.0}, "apart", 50.0),
        ("temperature_spindle_degC", {"noise": 0.5}, "tolerance", 0.5 * 6 * math.sqrt(2)),
        ("pressure_hPa", {}, "low", 500.0),
        ("force_x_N", {}, "fastest_per_s", math.inf),
        ("flow_1", {}, "high", math.inf),
    ],
)
def test_limits_are_by_name_and_unit_unless_the_configuration_says_them(name, key, value, limit):
    limits = quantity_limits(QuantityWire(name=name, gauge="g.c", **key))
    assert getattr(limits, value) == pytest.approx(limit)


def test_a_thermometer_that_stands_while_all_others_change_is_stuck(warm):
    vote = StandingTemperature(VoteSettings().standing_temperature_K)
    start_s = warm.now_s
    for name in warm.cabinet.shows:
        warm.cabinet.shows[name] = lambda time_s: 23.0 + 0.19 * (time_s - start_s)
    frozen = round(23.0, 2)
    warm.cabinet.shows["link_1"], warm.cabinet.noise_K["link_1"] = (lambda _: frozen), 0.0
    found = set()
    while warm.now_s < start_s + 12.0:
        warm.run(0.2)
        for number, text in vote.look(view(warm)):
            found.add(warm.memory.channels[number])
            assert "shows the same digits, while all others have changed by 2.0 K" in text
    assert found == {CHANNEL}


def view(live) -> MachineView:
    memory, n = live.memory, len(live.wired)
    nothing = np.full(n, math.nan)
    believed = (memory.doubt[:n] == Doubt.NONE) & ~np.isnan(memory.value[:n])
    return MachineView(live.now_s, memory, tuple(live.wired), memory.value[:n].copy(), believed, nothing, {}, None)


def test_a_force_may_change_by_anything_within_its_range():
    judge, memory = judged("force_x_N")
    values = [0.0, 40.0, -800.0, 3.0]
    readings = [
        judge.judge(good(value, 1000.0 + k), 0.0, good(value + 1.0, 1000.0 + k)) for k, value in enumerate(values)
    ]
    assert [reading.value for reading in readings] == values
    assert math.isinf(memory.tolerance_mm[0]), "nothing to be kept on disk"
    beyond = [judge.judge(good(3e4, 1010.0 + 0.1 * k), 0.0, good(3e4, 1010.0 + 0.1 * k)) for k in range(20)]
    assert beyond[0].quality is Quality.MISMATCH
    assert beyond[-1].quality is Quality.DISTRUSTED


def test_a_thermometer_that_is_asked_once_a_minute_may_change_meanwhile():
    judge, _ = judged("temperature_hall_degC")
    assert judge.judge(good(20.0, 1000.0), 0.0).quality is Quality.MISMATCH, "not confirmed"
    assert judge.judge(good(25.0, 1060.0), 0.0, good(20.0, 1000.0)).ok
    assert judge.judge(good(31.0, 1120.0), 0.0).ok
    assert not judge.judge(good(60.0, 1180.0), 0.0).ok


def judged(name):
    """The judge of one quantity by itself."""
    limits = quantity_limits(QuantityWire(name=name, gauge="g.c"))
    kept = limits.tolerance if math.isfinite(limits.fastest_per_s) else math.inf
    memory = TrustMemory(["g.c"], [kept], [unit_of(name)])
    return QuantityTrust(memory, "g.c", limits), memory
