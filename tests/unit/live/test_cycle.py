"""A cycle from readings to setpoint: stale gauges, machine zero, modes, recovery; the clock is a number."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from compd.configuration import load
from compd.errors import StateError
from compd.gauge import Quality
from compd.live.loop.commands import Target
from compd.live.loop.cycle import step
from compd.live.machine.machine_zero import MachineZero
from compd.live.service.state_json import to_plain
from compd.setpoint_states import Mode, State
from tests.support.live_machine import CONFIG, HOLD_S, PERIOD_S, RAW_AT_ZERO_MM, STEP_MM, Machine, machine
from tests.support.sampled import sampled

ZERO_TIP_M_MM = [0.0, 0.0, 190.0]


@pytest.fixture
def tripod():
    return machine()


def test_at_machine_zero_the_tip_is_where_the_configuration_says(tripod):
    setpoint = tripod.step()
    assert (setpoint.state, setpoint.reason, setpoint.mode) == (State.OK, "", Mode.CMM)
    assert setpoint.values.tip_M_mm == pytest.approx(ZERO_TIP_M_MM, abs=1e-9)
    assert setpoint.values.correction_mm == pytest.approx([0, 0, 0], abs=1e-12)
    assert setpoint.age_s == pytest.approx(0.001)
    assert setpoint.valid_until_s == pytest.approx(tripod.now_s + 0.1)
    assert not setpoint.tool_on_plate


def test_before_any_reading_it_is_starting_and_names_what_is_missing(tripod):
    setpoint = tripod.run_cycle()
    assert setpoint.state is State.STARTING
    assert not setpoint.valid
    assert setpoint.valid_until_s == setpoint.time_s
    assert "joint 1 to 9 (joints): never_read, frame t1 to t3 (cabinet): never_read" in setpoint.reason


def test_without_a_zero_every_setpoint_is_invalid_and_says_why_until_one_is_taken(tripod):
    zero = tripod.commands.zero
    tripod.commands.zero = StateError.of("here", "machine zero has never been taken", next_step="run `compd zero`")
    for _ in range(3):
        setpoint = tripod.step()
        assert setpoint.state is State.NO_ZERO
        assert not setpoint.valid
        assert setpoint.reason == "machine zero has never been taken; run `compd zero`"
    tripod.commands.zero = zero
    assert tripod.step().valid


def test_zero_is_subtracted_from_raw_readings_before_the_sign():
    plain = machine()
    wiring = plain.configuration.wiring
    first, *others = wiring.scale
    flipped = wiring.model_copy(update={"scale": (first.model_copy(update={"sign": -1}), *others)})
    turned = Machine(replace(plain.configuration, wiring=flipped))
    plain.change_mm["scale_1.position"] = 3.0
    turned.change_mm["scale_1.position"] = -3.0
    assert turned.step().values.tip_M_mm.tolist() == plain.step().values.tip_M_mm.tolist()


def test_a_joint_comparator_corrects_its_link_slewing_from_nothing(tripod):
    tripod.step()
    tripod.change_mm["joints.4"] = 0.02  # S of link 2: the link is shorter by that much, equation (1)
    corrections = [tripod.step().values.correction_mm[1] for _ in range(12)]
    assert np.diff([0.0, *corrections]).max() <= STEP_MM + 1e-12
    assert corrections[-1] == pytest.approx(0.02, abs=1e-6)
    assert tripod.step().state is State.OK
    assert tripod.step().values.contributions["joints"][1] == pytest.approx(0.02)


def test_the_first_correction_after_the_start_slews_too(tripod):
    tripod.change_mm["joints.4"] = 0.1
    setpoint = tripod.step()
    assert setpoint.state is State.SLEWING
    assert setpoint.valid
    assert setpoint.values.correction_mm[1] == pytest.approx(STEP_MM)
    assert "link 2" in setpoint.reason


@pytest.mark.parametrize("quality", [Quality.TIMEOUT, Quality.CRC, Quality.LINE_LOST, Quality.OVER_RANGE])
@pytest.mark.parametrize("on_stale", ["hold", "fade", "stop"])
def test_a_scale_that_is_lost_makes_the_tip_unknown_at_once_whatever_the_policy(on_stale, quality):
    tripod = machine(on_stale=on_stale)
    tripod.settle()
    tripod.faults["scale_2.position"] = quality
    setpoint = tripod.step()
    assert setpoint.state is State.STOP
    assert setpoint.values is None
    assert setpoint.reason == f"the tip is not known: scale 2 (scale_2.position): {quality}"
    del tripod.faults["scale_2.position"]
    assert tripod.step().state is State.OK


def test_a_reading_that_gets_old_is_stale_by_the_loops_limit(tripod):
    tripod.settle()
    tripod.frozen.add("cabinet.t2")
    states = [tripod.step() for _ in range(round(0.6 / PERIOD_S))]
    assert states[0].state is State.OK
    assert max(s.age_s for s in states if s.state is State.OK) == pytest.approx(0.5, abs=2 * PERIOD_S)
    assert states[-1].state is State.HOLD
    assert "frame t2 (cabinet.t2): stale" in states[-1].reason


def test_a_gauge_may_set_its_own_age_limit():
    configuration = load(CONFIG / "tripod-cmm.yaml")
    gauges = dict(configuration.gauges)
    gauges["cabinet"] = gauges["cabinet"].model_copy(update={"stale_after_s": 2.0})
    tripod = Machine(replace(configuration, gauges=gauges))
    tripod.settle()
    tripod.frozen.add("cabinet.t2")
    assert {tripod.step().state for _ in range(round(1.9 / PERIOD_S))} == {State.OK}


def test_hold_keeps_joints_and_frame_as_a_set_with_live_scales_and_then_stops(tripod):
    tripod.change_mm |= {"joints.4": 0.02, "cabinet.t1": 0.01}
    before = tripod.settle()
    tripod.faults["joints.1"] = Quality.TIMEOUT
    tripod.change_mm |= {"joints.4": 0.05, "cabinet.t1": 0.03, "scale_1.position": 1.0}
    held = tripod.step()
    assert held.state is State.HOLD
    assert held.valid
    assert "joint 1 (joints.1): timeout" in held.reason
    assert held.values.contributions["joints"].tolist() == before.values.contributions["joints"].tolist()
    assert held.values.tip_M_mm.tolist() != before.values.tip_M_mm.tolist(), "the scales are live"
    last = held
    while (setpoint := tripod.step()).valid:
        assert setpoint.state is State.HOLD
        assert setpoint.age_s > last.age_s, "the age is that of the readings used"
        assert setpoint.valid_until_s <= before.time_s + HOLD_S + 1e-9
        last = setpoint
    assert setpoint.state is State.STOP
    assert setpoint.time_s - before.time_s == pytest.approx(HOLD_S, abs=2 * PERIOD_S)
    assert setpoint.values is None


def test_fade_takes_the_correction_back_to_zero_and_then_stops():
    tripod = machine(on_stale="fade")
    tripod.change_mm["joints.4"] = 0.04
    before = tripod.settle()
    tripod.faults["cabinet.t3"] = Quality.SENSOR_FAULT
    faded = []
    while (setpoint := tripod.step()).valid:
        assert setpoint.state is State.FADE
        faded.append(setpoint.values.correction_mm[1])
    assert setpoint.state is State.STOP
    assert np.all(np.diff([before.values.correction_mm[1], *faded]) < 0)
    assert faded[len(faded) // 2] == pytest.approx(0.02, rel=0.02)
    assert abs(faded[-1]) < 1e-4


def test_stop_is_invalid_at_once():
    tripod = machine(on_stale="stop")
    tripod.settle()
    tripod.faults["joints.9"] = Quality.INCOMPLETE
    setpoint = tripod.step()
    assert setpoint.state is State.STOP
    assert setpoint.reason == "joint 9 (joints.9): incomplete"


@pytest.mark.parametrize("on_stale", ["hold", "fade", "stop"])
@pytest.mark.parametrize("lost_for_s", sampled([6.0, 0.1, 2.0], 3))
def test_recovery_never_jumps(on_stale, lost_for_s):
    tripod = machine(on_stale=on_stale)
    tripod.change_mm["joints.4"] = 0.02
    last = tripod.settle().values.correction_mm
    tripod.faults["joints.1"] = Quality.TIMEOUT
    tripod.change_mm["joints.4"] = 0.09
    for _ in range(round(lost_for_s / PERIOD_S)):
        setpoint = tripod.step()
        if setpoint.valid:
            assert np.abs(setpoint.values.correction_mm - last).max() <= STEP_MM + 1e-12
            last = setpoint.values.correction_mm
    tripod.faults.clear()
    for _ in range(40):
        setpoint = tripod.step()
        assert setpoint.valid
        assert np.abs(setpoint.values.correction_mm - last).max() <= STEP_MM + 1e-12
        last = setpoint.values.correction_mm
    assert setpoint.state is State.OK
    assert last[1] == pytest.approx(0.09, abs=1e-6)


def test_a_clamped_correction_says_why_and_the_tip_moves_no_further(tripod):
    tripod.step()
    tripod.change_mm["joints.4"] = 0.2
    at_limit = tripod.settle() if tripod.step().state is not State.CLAMPED else None
    tripod.change_mm["joints.4"] = 0.9
    for _ in range(50):
        setpoint = tripod.step()
    assert setpoint.state is State.CLAMPED
    assert setpoint.valid
    assert setpoint.reason == "link 2: correction 0.900 mm beyond 0.200 mm, clamped"
    assert setpoint.values.correction_mm[1] == pytest.approx(0.2)
    assert at_limit is not None
    assert setpoint.values.tip_M_mm == pytest.approx(at_limit.values.tip_M_mm, abs=2e-4), "second order in 0.2 mm"
    assert setpoint.values.contributions["joints"][1] == pytest.approx(0.9), "what was asked for is told"


def test_beyond_the_limit_with_refuse_there_is_no_setpoint():
    tripod = machine(on_limit="refuse")
    tripod.settle()
    tripod.change_mm["joints.4"] = 0.9
    setpoint = tripod.step()
    assert setpoint.state is State.REFUSED
    assert setpoint.values is None
    assert setpoint.reason == "link 2: correction 0.900 mm beyond 0.200 mm, refused"
    tripod.change_mm["joints.4"] = 0.0
    assert tripod.step().state is State.OK


def test_gauges_that_no_frame_fits_are_refused_by_name_and_the_next_good_cycle_is_fine(tripod):
    tripod.settle()
    tripod.change_mm["cabinet.t1"] = -900.0
    setpoint = tripod.step()
    assert setpoint.state is State.REFUSED
    assert "cannot be computed" in setpoint.reason
    tripod.change_mm["cabinet.t1"] = 0.0
    assert tripod.step().state is State.OK


def test_a_target_needs_no_scales_and_is_met_by_the_scale_setpoint(tripod):
    tripod.change_mm |= {"joints.4": 0.01, "cabinet.t1": 0.004}
    tripod.settle()
    for link in (1, 2, 3):
        tripod.faults[f"scale_{link}.position"] = Quality.LINE_LOST
    tripod.commands.target = Target((10.0, -20.0, -500.0))
    setpoint = tripod.settle()
    assert setpoint.mode is Mode.MACHINE_TOOL
    assert setpoint.values.tip_B0_mm == pytest.approx([10, -20, -500])
    # the machine follows: its scales now show the setpoint, and CMM mode finds the tip on the target
    tripod.faults.clear()
    for link, value in enumerate(setpoint.values.scale_setpoint_mm, start=1):
        tripod.change_mm[f"scale_{link}.position"] = float(value)
    tripod.commands.target = None
    reached = tripod.settle()
    assert reached.mode is Mode.CMM
    assert reached.values.tip_B0_mm == pytest.approx([10, -20, -500], abs=1e-8)


def test_a_target_out_of_reach_is_refused_by_name(tripod):
    tripod.settle()
    tripod.commands.target = Target((50_000.0, 0.0, -510.0))
    setpoint = tripod.step()
    assert setpoint.state is State.REFUSED
    assert setpoint.mode is Mode.MACHINE_TOOL
    assert "this target cannot be computed" in setpoint.reason
    tripod.commands.target = Target((0.0, 0.0, -510.0))
    assert tripod.step().valid


def test_a_target_beyond_the_links_stroke_is_refused_with_link_and_length(tripod):
    tripod.commands.target = Target((0.0, 0.0, -250.0))
    setpoint = tripod.step()
    assert (setpoint.state, setpoint.valid) == (State.REFUSED, False)
    assert "link 1: " in setpoint.reason
    assert "beyond its stroke, 330 to 660 mm" in setpoint.reason


def test_a_hexapods_target_may_turn_the_platform():
    hexapod = machine("hexapod.yaml")
    hexapod.settle()
    hexapod.commands.target = Target((0.0, 0.0, -580.0), (0.0, 0.0, 0.1))
    turned = hexapod.settle()
    hexapod.commands.target = Target((0.0, 0.0, -580.0))
    straight = hexapod.settle()
    assert len(turned.values.scale_setpoint_mm) == 6
    assert np.abs(turned.values.scale_setpoint_mm - straight.values.scale_setpoint_mm).max() > 1
    assert straight.values.scale_setpoint_mm == pytest.approx(np.zeros(6), abs=1e-8)


def test_the_same_snapshots_give_the_same_setpoints_bit_for_bit():
    first, second = machine(), machine()
    random = np.random.default_rng(7)
    for _ in range(50):
        changes = {channel: float(random.normal(0, 0.005)) for channel in first.change_mm}
        first.change_mm |= changes
        second.change_mm |= changes
        a, b = first.step(), second.step()
        assert a.to_json() == b.to_json()
        assert a.to_packet(bytes(8)) == b.to_packet(bytes(8))


def test_a_step_changes_neither_state_nor_inputs_and_may_be_repeated(tripod):
    tripod.change_mm |= {"joints.4": 0.02, "cabinet.t1": 0.004}
    tripod.settle()
    before, setpoint = tripod.state, tripod.step()
    first, after = step(before, setpoint.inputs, tripod.settings)
    step(after, setpoint.inputs._replace(tick=tripod.tick + 1), tripod.settings)
    second, after_again = step(before, setpoint.inputs, tripod.settings)
    assert first.to_packet(bytes(8)) == second.to_packet(bytes(8)) == setpoint.to_packet(bytes(8))
    states = [to_plain(state._replace(zero=None)) for state in (after, after_again, tripod.state)]
    assert states[0] == states[1] == states[2]


def test_an_invalid_setpoint_keeps_the_correction_that_is_applied(tripod):
    tripod.change_mm["joints.4"] = 0.02
    tripod.settle()
    before = tripod.state
    tripod.faults["scale_1.position"] = Quality.TIMEOUT
    assert not tripod.step().valid
    assert tripod.state.correction_mm is before.correction_mm


def test_a_new_zero_leaves_nothing_of_the_old_one_and_does_not_jump(tripod):
    tripod.change_mm |= dict.fromkeys(tripod.wires.length_channels, 0.03)
    before = tripod.settle()
    zero = MachineZero("", "", dict.fromkeys(tripod.wires.length_channels, RAW_AT_ZERO_MM + 0.03))
    tripod.commands.zero = zero
    setpoint = tripod.step()
    assert setpoint.values.tip_M_mm == pytest.approx(ZERO_TIP_M_MM, abs=1e-9)
    assert np.abs(setpoint.values.correction_mm - before.values.correction_mm).max() <= STEP_MM + 1e-12
    assert tripod.settle().values.correction_mm == pytest.approx([0, 0, 0], abs=1e-9)


def test_an_unusable_thermometer_is_nan_and_stops_nothing(tripod):
    tripod.settle()
    tripod.faults["cabinet.room"] = Quality.SENSOR_FAULT
    assert tripod.step().state is State.OK
    wires = tripod.wires.quantity_wires(["temperature_room_degC", "temperature_link_1_degC"])
    read = wires.read(tripod.latest.snapshot(tripod.now_s), np.zeros(2))
    assert math.isnan(read.values[0])
    assert read.values[1] == 20.0
    assert "temperature_room_degC (cabinet.room): sensor_fault" in read.lost


def test_a_target_that_is_too_old_is_a_stop_until_another_comes_and_never_cmm_mode(tripod):
    tripod.settle()
    now_s = tripod.step().time_s
    tripod.commands.target = Target((10.0, -20.0, -500.0), valid_until_s=now_s + 3 * PERIOD_S)
    states = [tripod.step() for _ in range(6)]
    assert [setpoint.valid for setpoint in states] == [True, True, True, False, False, False]
    assert all(setpoint.valid_until_s <= now_s + 3 * PERIOD_S + 1e-9 for setpoint in states[:3]), (
        "nor is it used longer"
    )
    assert {(setpoint.state, setpoint.mode) for setpoint in states[3:]} == {(State.STOP, Mode.MACHINE_TOOL)}
    assert "the controller's target is too old" in states[-1].reason
    tripod.commands.target = Target((10.0, -20.0, -500.0), valid_until_s=now_s + 60)
    assert tripod.step().valid
