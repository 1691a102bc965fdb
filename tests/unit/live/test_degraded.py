"""What is published when something is missing for good, and which gauge or effect a reason names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compd.gauge import Quality
from compd.live.loop.commands import Target
from compd.live.machine.reasons import MAX_NAMED_BYTES, GaugeFault, lost
from compd.setpoint_states import State
from tests.support.live_machine import HOLD_S, PERIOD_S, STEP_MM, machine
from tests.support.live_models import thermal, warm, with_noise

STALE = (Quality.STALE, "")
FRAME = ("cabinet.t1", "cabinet.t2", "cabinet.t3")


@pytest.fixture
def tripod():
    tripod = with_noise(machine(on_stale="degrade"), 0.1)
    tripod.change_mm["joints.1"] = 0.02
    tripod.change_mm["cabinet.t1"] = 0.03
    tripod.settle()
    return tripod


def after_fade(tripod):
    """The setpoints until the fade has ended and the correction has slewed."""
    return [tripod.step() for _ in range(int((HOLD_S + 0.5) / PERIOD_S))]


def test_what_is_lost_fades_and_is_then_absent_while_the_rest_goes_on(tripod):
    before = tripod.step()
    tripod.faults |= dict.fromkeys(FRAME, Quality.LINE_LOST)
    setpoints = after_fade(tripod)
    assert all(setpoint.valid for setpoint in setpoints)
    assert {setpoint.state for setpoint in setpoints[10:-200]} == {State.FADE}
    last = setpoints[-1]
    assert last.state is State.DEGRADED
    assert "the correction of frame is absent" in last.reason
    assert "frame t1 to t3 (cabinet): line_lost" in last.reason
    assert last.values.contributions["frame"] == pytest.approx([0, 0, 0], abs=1e-9)
    assert last.values.contributions["joints"] == pytest.approx(before.values.contributions["joints"])
    tripod.change_mm["joints.1"] = 0.01
    assert tripod.step().values.contributions["joints"] != pytest.approx(
        before.values.contributions["joints"], abs=1e-4
    )


def test_what_is_absent_counts_in_the_bound_of_the_tip_s_error(tripod):
    right = tripod.settle()
    tripod.faults |= dict.fromkeys(FRAME, Quality.LINE_LOST)
    for setpoint in after_fade(tripod)[::50]:
        error_um = 1e3 * np.linalg.norm(setpoint.values.tip_M_mm - right.values.tip_M_mm)
        assert error_um < setpoint.u_tip_um < error_um + 2 * right.u_tip_um
    assert error_um > 10.0, "30 um of the frame are not corrected any more"


def test_how_far_the_machine_has_gone_since_a_group_was_read_counts_in_the_bound():
    """A frame that nobody reads bends elsewhere by another amount, also when the machine stands there."""
    tripod = with_noise(machine(on_stale="degrade", tip_error_um=None), 0.1)
    tripod.settle()
    tripod.faults |= dict.fromkeys(FRAME, Quality.LINE_LOST)
    there_um = after_fade(tripod)[-1].u_tip_um
    for k in range(100):
        tripod.change_mm["scale_1.position"] = 0.1 * min(k, 50)
        setpoint = tripod.step()
    assert setpoint.valid
    assert setpoint.u_tip_um > there_um + 100.0


def test_what_a_faded_set_does_not_correct_counts_in_the_bound():
    tripod = with_noise(machine(on_stale="fade"), 0.1)
    tripod.change_mm |= {"joints.1": 0.02, "cabinet.t1": 0.03}
    right = tripod.settle()
    tripod.faults |= dict.fromkeys(FRAME, Quality.LINE_LOST)
    for setpoint in after_fade(tripod)[10:900:50]:
        assert setpoint.state is State.FADE
        error_um = 1e3 * np.linalg.norm(setpoint.values.tip_M_mm - right.values.tip_M_mm)
        assert error_um < setpoint.u_tip_um < 1.1 * error_um + 2 * right.u_tip_um


def test_what_a_limit_does_not_let_through_counts_in_the_bound():
    tripod = with_noise(machine(), 0.1)
    tripod.change_mm["joints.1"] = 0.3
    clamped = [tripod.step() for _ in range(200)][-1]
    assert clamped.state is State.CLAMPED
    free = with_noise(machine(correction_mm=1.0), 0.1)
    free.change_mm["joints.1"] = 0.3
    error_um = 1e3 * np.linalg.norm(clamped.values.tip_M_mm - free.settle().values.tip_M_mm)
    assert error_um < clamped.u_tip_um < 1.05 * error_um + 2.0


def test_the_correction_slews_on_every_change_there_and_back(tripod):
    tripod.faults |= dict.fromkeys(FRAME, Quality.LINE_LOST)
    setpoints = after_fade(tripod)
    tripod.faults.clear()
    setpoints += [tripod.step() for _ in range(200)]
    assert setpoints[-1].state is State.OK
    applied = np.array([setpoint.values.correction_mm for setpoint in setpoints])
    assert np.abs(np.diff(applied, axis=0)).max() <= STEP_MM + 1e-12
    tips = np.array([setpoint.values.tip_M_mm for setpoint in setpoints])
    assert np.abs(np.diff(tips, axis=0)).max() <= 5 * STEP_MM, "nor does the tip jump"


def test_before_everything_has_been_good_once_nothing_is_published():
    tripod = machine(on_stale="degrade")
    tripod.faults |= dict.fromkeys(FRAME, Quality.TIMEOUT)
    assert tripod.step().state is State.STARTING


def test_every_group_that_is_absent_is_named(tripod):
    tripod.faults |= dict.fromkeys(FRAME, Quality.TIMEOUT)
    tripod.faults["joints.1"] = Quality.TIMEOUT
    assert "the correction of joints and frame is absent" in after_fade(tripod)[-1].reason


def test_effects_whose_thermometer_is_lost_count_as_what_they_corrected_and_then_leave_the_bound_unknown(tmp_path):
    tripod = machine(on_stale="degrade", tip_error_um=None)
    tripod.commands.models = thermal(tripod, tmp_path)
    warm(tripod, 25.0)
    right = tripod.settle()
    tripod.faults |= dict.fromkeys((f"cabinet.link_{k}" for k in (1, 2, 3)), Quality.TIMEOUT)
    setpoints = after_fade(tripod)
    fading = setpoints[500]
    error_um = 1e3 * np.linalg.norm(fading.values.tip_M_mm - right.values.tip_M_mm)
    assert 3.0 < error_um < fading.u_tip_um < 1.05 * error_um + right.u_tip_um
    assert setpoints[-1].state is State.DEGRADED
    assert np.isnan(setpoints[-1].u_tip_um), "nobody knows what they would correct now"


@pytest.mark.parametrize(
    ("on_stale", "state"), [("stop", State.FAULT), ("hold", State.HOLD), ("fade", State.FADE), ("degrade", State.FADE)]
)
def test_a_comparator_that_is_not_believed_is_replaced_like_a_lost_one(on_stale, state):
    tripod = machine(on_stale=on_stale)
    tripod.settle()
    tripod.faults["joints.1"] = Quality.DISTRUSTED
    tripod.step()
    assert tripod.step().state is state


@pytest.mark.parametrize(("on_stale", "state"), [("hold", State.FAULT), ("degrade", State.DEGRADED)])
def test_when_that_has_ended_a_person_is_waited_for(on_stale, state):
    tripod = machine(on_stale=on_stale)
    tripod.settle()
    tripod.faults["joints.1"] = Quality.DISTRUSTED
    assert after_fade(tripod)[-1].state is state


def test_a_scale_that_is_not_believed_is_a_fault_at_once():
    tripod = machine()
    tripod.settle()
    tripod.faults["scale_1.position"] = Quality.DISTRUSTED
    setpoint = tripod.step()
    assert (setpoint.state, setpoint.valid) == (State.FAULT, False)
    assert "scale 1 (scale_1.position): distrusted" in setpoint.reason


def test_in_machine_tool_mode_scales_count_where_they_are_compared_with_the_setpoints():
    tripod = machine()
    tripod.settle()
    tripod.commands.target = Target((0.0, 0.0, -510.0))
    tripod.settle()
    tripod.faults["scale_1.position"] = Quality.LINE_LOST
    assert tripod.step().state is State.OK
    tripod.settings = replace(tripod.settings, scales_checked=True)
    setpoint = tripod.step()
    assert (setpoint.state, setpoint.valid) == (State.DEGRADED, True)
    assert "not compared with the setpoint: scale 1" in setpoint.reason
    tripod.faults["scale_1.position"] = Quality.DISTRUSTED
    assert tripod.step().state is State.FAULT


def test_a_reason_names_gauges_in_groups_and_is_never_long():
    tripod = machine()
    tripod.settle()
    lengths = tripod.wires.length_channels
    tripod.faults |= dict.fromkeys(lengths, Quality.LINE_LOST)
    tripod.faults["scale_2.position"] = Quality.TIMEOUT
    setpoint = tripod.step()
    assert "scale 2 (scale_2.position): timeout" in setpoint.reason
    assert "joint 1 to 9 (joints): line_lost, frame t1 to t3 (cabinet): line_lost" in setpoint.reason
    for k, channel in enumerate(lengths):
        tripod.faults[channel] = list(Quality)[1 + k % (len(Quality) - 1)]
    reason = tripod.step().reason
    assert len(reason.encode()) <= 2 * MAX_NAMED_BYTES
    assert "..." not in reason
    assert "joint" in reason


@pytest.mark.parametrize(
    ("count", "text"),
    [
        (4, "joint 1 (g1.position): timeout (no reply after 1 s)"),
        (12, "joint 1, 3, 5, 7, 9, 11: timeout; joint 2, 4, 6, 8, 10, 12: stale"),
        (200, "100 gauges: timeout; 100 gauges: stale"),
    ],
)
def test_the_more_gauges_the_fewer_words_for_each_and_no_reason_is_cut(count, text):
    faults = [
        GaugeFault(f"joint {k}", f"g{k}.position", *((Quality.TIMEOUT, f"no reply after {k} s") if k % 2 else STALE))
        for k in range(1, count + 1)
    ]
    reason = str(lost(faults))
    assert reason.startswith(text)
    assert len(reason.encode()) <= MAX_NAMED_BYTES


def test_a_cycle_that_cannot_be_computed_names_the_gauge():
    tripod = machine()
    tripod.settle()
    tripod.change_mm["frame_u.u1"] = 1e15
    setpoint = tripod.step()
    assert setpoint.state is State.REFUSED
    assert "frame u1 (frame_u.u1) is 1e+15 mm from machine zero" in setpoint.reason


def test_a_tip_that_is_valid_never_jumps_in_cmm_mode(tripod):
    before = tripod.step().values.tip_M_mm
    tripod.change_mm["frame_u.u1"] = 0.05
    setpoint = tripod.step()
    assert setpoint.state is State.SLEWING
    assert np.abs(setpoint.values.tip_M_mm - before).max() < 5 * STEP_MM
    assert np.abs(tripod.settle().values.tip_M_mm - before).max() > 0.01


def test_after_an_invalid_setpoint_the_tip_is_right_at_once(tripod):
    tripod.change_mm["frame_u.u1"] = 0.05
    right = tripod.settle().values.tip_M_mm
    tripod.change_mm["frame_u.u1"] = 0.0
    tripod.settle()
    tripod.faults["scale_1.position"] = Quality.TIMEOUT
    assert not tripod.step().valid
    tripod.faults.clear()
    tripod.change_mm["frame_u.u1"] = 0.05
    setpoint = tripod.step()
    assert setpoint.state is State.SLEWING
    assert setpoint.values.tip_M_mm == pytest.approx(right, abs=1e-6)


@pytest.mark.parametrize("count", [2, 6, 40])
def test_a_reason_of_any_length_says_how_a_person_accepts(count: int) -> None:
    why = "differs from what the others say by 31 mm: inspect it and its cable, then `compd accept"
    gauges = [f"scale_{k}" for k in range(1, count + 1)]
    faults = [
        GaugeFault(f"scale {k}", f"{gauge}.position", Quality.DISTRUSTED, f"{why} {gauge}`")
        for k, gauge in enumerate(gauges, 1)
    ]
    text = str(lost(faults))
    assert text.startswith("waits for a person: ")
    assert "compd accept all" in text or all(f"compd accept {gauge}" in text for gauge in gauges)
    assert len(text.encode()) <= MAX_NAMED_BYTES + len("waits for a person: ")
