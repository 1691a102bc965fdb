"""How far apart the lengths of a setpoint were measured: said in every message, limited where that is configured."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from compd.configuration import load
from compd.errors import ConfigurationError
from compd.gauge import Quality, good
from compd.live.loop.commands import Target
from compd.recording import read_recording
from compd.setpoint_states import State
from tests.support.live_machine import RAW_AT_ZERO_MM, machine
from tests.support.paths import CONFIG
from tests.support.recorded_run import Run


def apart(live, delays_s):
    """One cycle in which these channels were read so many seconds before all others."""
    live.now_s += 0.2
    live.tick += 1
    for channel, slot in live.latest.index.items():
        value = RAW_AT_ZERO_MM if channel in live.change_mm else 20.0
        live.latest.put(slot, good(value, live.now_s - 0.001 - delays_s.get(channel, 0.0)))
    return live.run_cycle()


def with_limit(skew_s):
    live = machine()
    live.settings = replace(live.settings, loop=live.settings.loop.model_copy(update={"skew_s": skew_s}))
    return live


def test_a_setpoint_says_how_far_apart_its_lengths_were_measured():
    setpoint = apart(machine(), {"joints.3": 0.174, "scale_2.position": 0.01})
    assert setpoint.state is State.OK
    assert setpoint.skew_s == pytest.approx(0.174)
    assert json.loads(setpoint.to_json())["skew_s"] == 0.174


def test_a_thermometer_is_no_length():
    setpoint = apart(machine(), {"cabinet.room": 0.3, "cabinet.t1": 0.02})
    assert setpoint.skew_s == pytest.approx(0.02)


def test_in_machine_tool_mode_the_scales_do_not_count():
    live = machine()
    tip_mm = tuple(live.step().values.tip_B0_mm.tolist())
    live.commands.target = Target(tip_mm)
    assert apart(live, {"scale_1.position": 0.1}).skew_s == pytest.approx(0.0)
    assert apart(live, {"scale_1.position": 0.1, "frame_u.u2": 0.05}).skew_s == pytest.approx(0.05)


def test_beyond_the_limit_a_setpoint_is_refused_and_names_both_ends():
    live = with_limit(0.05)
    assert apart(live, {"joints.3": 0.049}).state is State.OK
    refused = apart(live, {"joints.3": 0.06, "frame_u.u1": 0.02})
    assert (refused.state, refused.valid) == (State.REFUSED, False)
    assert refused.reason.startswith("the readings are 60 ms apart, allowed 50 ms (`loop.skew_s`): the oldest is ")
    assert "the oldest is joint 3 (joints.3), the newest scale 1 (scale_1.position)" in refused.reason
    assert refused.skew_s == pytest.approx(0.06)
    assert apart(live, {"joints.3": 0.01}).state is State.OK


def test_a_set_that_was_refused_is_not_held_later():
    live = with_limit(0.05)
    before = apart(live, {})
    live.change_mm["joints.4"] = 0.0
    apart(live, {"joints.3": 0.06})
    assert live.state.last_good.time_s == before.time_s


def test_while_comparators_are_held_their_age_is_skew_and_hold_s_limits_it():
    live = with_limit(0.05)
    live.settle()
    live.faults["joints.1"] = Quality.LINE_LOST
    for _ in range(40):
        held = live.step()
    assert held.state is State.HOLD
    assert held.skew_s == pytest.approx(0.2, abs=0.01)


@pytest.mark.long
@pytest.mark.parametrize("lost", ["joints.1", "cabinet.t1"])
def test_degraded_groups_count_until_they_are_absent(lost):
    live = machine(on_stale="degrade")
    live.settings = replace(live.settings, loop=live.settings.loop.model_copy(update={"skew_s": 0.05}))
    live.settle()
    live.faults[lost] = Quality.LINE_LOST
    for _ in range(40):
        fading = live.step()
    assert fading.state is State.FADE
    assert fading.skew_s == pytest.approx(0.2, abs=0.01)
    for _ in range(1000):
        absent = live.step()
    assert absent.state is State.DEGRADED
    assert absent.skew_s == pytest.approx(0.0, abs=1e-9)


def test_before_the_first_reading_there_is_no_skew():
    setpoint = machine().run_cycle()
    assert math.isnan(setpoint.skew_s)
    assert b"skew_s" not in setpoint.to_json()


def test_the_limit_is_a_time(tmp_path):

    text = (CONFIG / "tripod-cmm.yaml").read_text()
    for value, allowed in (("0.05", True), ("0", False), ("soon", False)):
        file = tmp_path / "machine.yaml"
        file.write_text(text.replace("  hold_s: 5 ", f"  skew_s: {value}\n  hold_s: 5 ", 1))
        if allowed:
            assert load(file).loop.skew_s == 0.05
        else:
            with pytest.raises(ConfigurationError, match="skew_s"):
                load(file)


def test_the_skew_of_a_recorded_row_is_a_column_and_no_covariate(tmp_path):

    run = Run(machine())
    with run.recorder(tmp_path / "run") as recorder:
        for line, message, _ in run.quiet(5):
            recorder.put(line, message)
    header, *rows = (tmp_path / "run-0001.csv").read_text().splitlines()
    assert [dict(zip(header.split(","), row.split(","), strict=True))["skew_s"] for row in rows] == ["0"] * 5
    recording = read_recording(tmp_path / "run-0001.csv", run.machine.configuration, needs_reference=False)
    assert recording.warnings == ()
    assert "skew_s" not in recording.quantities
