"""A cycle on the move: the tip at the cycle's own time, its uncertainty, and the same bytes again in a replay."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from compd.gauge import Quality, ReadingMotion, bad, good
from compd.live.loop.commands import Target
from compd.live.loop.states import State
from compd.live.record.replay import RecordedCycles, replay_cycles
from compd.live.service.message_keys.readings import ReadingsKeys
from tests.support.live_machine import RAW_AT_ZERO_MM, machine
from tests.support.live_models import with_noise
from tests.support.recorded_run import Run

SPEED_MM_PER_S = 50.0
AGES_S = {"scale_1.position": 0.02, "scale_2.position": 0.05, "scale_3.position": 0.01, "joints.4": 0.17}
SPEEDS = {"scale_1.position": 50.0, "scale_2.position": -30.0, "scale_3.position": 10.0, "joints.4": 0.05}


def moving(live, u=0.0, cycles=1, horizon_s=1.0, extrapolate=True):
    """The last setpoint of some cycles in which lengths move steadily and are read at different times."""
    live.settings = replace(live.settings, loop=live.settings.loop.model_copy(update={"extrapolate": extrapolate}))
    for _ in range(cycles):
        live.now_s += 0.005
        live.tick += 1
        for channel, slot in live.latest.index.items():
            speed, age_s = SPEEDS.get(channel, 0.0), AGES_S.get(channel, 0.001)
            time_s = live.now_s - age_s
            value = RAW_AT_ZERO_MM + speed * (time_s - 1000.0) if channel in live.change_mm else 20.0
            motion = ReadingMotion(speed, 0.0, u, horizon_s) if channel in live.change_mm else None
            live.latest.put(slot, good(value, time_s)._replace(motion=motion))
        setpoint = live.run_cycle()
    return setpoint


def at_once(live, now_s):
    """The setpoint where every length is read at the tick."""
    live.change_mm |= {channel: speed * (now_s - 1000.0) for channel, speed in SPEEDS.items()}
    return live.step()


def quick(live):
    limits = live.settings.limits.model_copy(update={"slew_mm_per_s": 1e6})
    live.settings = replace(live.settings, limits=limits)
    return live


def test_the_tip_is_where_it_is_at_the_time_of_the_cycle():
    setpoint = moving(quick(machine()), cycles=20)
    truth = at_once(quick(machine()), setpoint.time_s)
    as_read = moving(quick(machine()), cycles=20, extrapolate=False)
    assert setpoint.values.tip_M_mm == pytest.approx(truth.values.tip_M_mm, abs=1e-9)
    assert setpoint.values.correction_mm == pytest.approx(truth.values.correction_mm, abs=1e-9)
    assert np.linalg.norm(as_read.values.tip_M_mm - truth.values.tip_M_mm) > 0.5


def test_age_and_skew_stay_those_of_the_measurements():
    setpoint = moving(machine())
    assert setpoint.age_s == pytest.approx(0.17)
    assert setpoint.skew_s == pytest.approx(0.169)


def test_readings_without_a_motion_are_used_as_they_are():
    live = quick(machine())
    moving(live)
    still = quick(machine())
    still.change_mm["scale_1.position"] = 1.0
    assert still.step().values.scale_setpoint_mm == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)


def test_the_uncertainty_of_the_tip_grows_with_age_and_how_surely_the_motion_is_known():
    at_rest = with_noise(machine(), 0.1).step().values.u_tip_um
    known, vague, as_read = (
        moving(with_noise(machine(), 0.1), u=u, extrapolate=extrapolate).values.u_tip_um
        for u, extrapolate in ((0.0, True), (2.0, True), (0.0, False))
    )
    assert (known > at_rest).all()
    assert (vague > known).all()
    assert (as_read > 5 * known).all()


@pytest.mark.long
def test_the_uncertainty_by_age_is_that_of_each_length_changed_by_itself():
    u_mm_per_s, step_mm = 2.0, 1e-3
    live = with_noise(machine(), 0.1)
    u_um = moving(live, u=u_mm_per_s).values.u_tip_um
    variance = with_noise(machine(), 0.1).step().values.u_tip_um ** 2
    for channel in live.change_mm:
        moved = []
        for sign in (1, -1):
            changed = quick(machine())
            changed.change_mm |= {name: speed * 0.005 for name, speed in SPEEDS.items()}
            changed.change_mm[channel] += sign * step_mm
            moved.append(changed.step().values.tip_M_mm)
        tip_by_length = (moved[0] - moved[1]) / (2 * step_mm)
        late_mm = 1e-3 * abs(SPEEDS.get(channel, 0.0)) + u_mm_per_s * AGES_S.get(channel, 0.001)
        variance = variance + (1e3 * tip_by_length * late_mm) ** 2
    assert u_um == pytest.approx(np.sqrt(variance), rel=2e-3)


def test_the_age_of_the_scales_does_not_count_where_they_are_not_used():
    live = with_noise(machine(), 0.1)
    tip_mm = tuple(live.step().values.tip_B0_mm.tolist())
    live.commands.target = Target(tip_mm)
    u_um = moving(live, u=0.0, extrapolate=False).values.u_tip_um
    assert np.linalg.norm(u_um) < 50.0, "the joint alone: 0.17 s at 0.05 mm/s"


def test_a_motion_that_is_not_known_yet_leaves_no_uncertainty():
    setpoint = moving(with_noise(machine(), 0.1), u=float("nan"))
    assert setpoint.valid
    assert b"u_tip_um" not in setpoint.to_json()


def test_a_silent_gauge_is_held_where_it_was_carried_to():
    live = quick(machine())
    first = moving(live, horizon_s=0.1)
    tips = []
    for _ in range(40):
        live.now_s += 0.005
        tips.append(live.run_cycle().values.tip_M_mm)
    assert tips[-1] == pytest.approx(tips[-10], abs=1e-9)
    assert np.linalg.norm(tips[-1] - first.values.tip_M_mm) > 1.0


def held(live):
    """The setpoint a second later, when all stand still and joint 4 is lost."""
    live.now_s += 1.0
    live.tick += 1
    for channel, slot in live.latest.index.items():
        fresh = good(RAW_AT_ZERO_MM if channel in live.change_mm else 20.0, live.now_s)
        motion = ReadingMotion(0.0, 0.0, 0.0, 1.0) if channel in live.change_mm else None
        live.latest.put(slot, fresh._replace(motion=motion))
    live.latest.put(live.latest.index["joints.4"], bad(live.now_s, Quality.TIMEOUT))
    setpoint = live.run_cycle()
    assert setpoint.state is State.HOLD
    return setpoint


def test_the_uncertainty_of_the_tip_grows_while_a_set_of_comparators_is_held():
    live = with_noise(machine(on_stale="hold"), 0.1)
    moving(live, u=0.0)
    u_um = [np.linalg.norm(held(live).values.u_tip_um) for _ in range(2)]
    assert u_um[0] > 10.0, "joint 4 may have moved on by 0.05 mm/s for 1.17 s"
    assert u_um[1] / u_um[0] == pytest.approx(2.17 / 1.17, rel=0.02)


def test_how_uncertain_the_speeds_were_counts_while_a_set_is_held():
    live_um = []
    for u_mm_per_s in (0.0, 0.1):
        live = with_noise(machine(on_stale="hold"), 0.1)
        moving(live, u=u_mm_per_s)
        live_um.append(held(live).values.u_tip_um)
    assert (live_um[1] > 2.0 * live_um[0]).all()


def test_a_set_held_before_its_motion_is_known_leaves_no_uncertainty():
    live = with_noise(machine(on_stale="hold"), 0.1)
    moving(live, u=float("nan"))
    assert b"u_tip_um" not in held(live).to_json()


def test_a_held_set_replays_bit_for_bit(tmp_path):
    run = Run(with_noise(machine(on_stale="hold"), 0.1))
    sent = []
    with run.recorder(tmp_path / "run") as recorder:
        for k in range(4):
            setpoint = held(run.machine) if k else moving(run.machine, u=0.5)
            line, message, _ = run.recorded(setpoint)
            recorder.put(line, message)
            sent.append(setpoint.to_json())
    replayed = list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))
    assert [cycle.replayed for cycle in replayed] == sent


def test_a_run_on_the_move_replays_bit_for_bit_and_says_how_each_length_moves(tmp_path):
    run = Run(with_noise(machine(), 0.1))
    sent = []
    with run.recorder(tmp_path / "run") as recorder:
        for k in range(30):
            setpoint = moving(run.machine, u=0.5 if k else float("nan"))
            line, message, _ = run.recorded(setpoint)
            recorder.put(line, message)
            sent.append(setpoint.to_json())
    assert len(set(sent)) == 30
    ReadingsKeys.model_validate({key: message[key] for key in message if key != "class"})
    assert message["readings"]["scale_1.position"]["motion"]["speed_mm_per_s"] == SPEED_MM_PER_S
    replayed = list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))
    assert [cycle.replayed for cycle in replayed] == sent
    table = (tmp_path / "run-0001.csv").read_text().splitlines()
    assert dict(zip(table[0].split(","), table[-1].split(","), strict=True))["skew_s"] == "0.169"


def test_a_recording_of_a_release_without_motion_replays_as_it_was(tmp_path):
    """As 0.2.0 wrote them: no motion with the readings, no skew in the setpoint, no sensitivities in the state."""
    run = Run(with_noise(machine(), 0.1))
    with run.recorder(tmp_path / "run") as recorder:
        for line, message, _ in run.quiet(20):
            recorder.put(line, message)
    path = tmp_path / "run-0001.cycles.jsonl"
    first, watch, *cycles = path.read_text().splitlines()
    older = []
    for cycle in cycles:
        message = json.loads(cycle)
        del message["setpoint"]["skew_s"]
        message["carried"].pop("tip_by_gauge", None)
        message["carried"]["last_good"].pop("length_times_s", None)
        message["carried"]["last_good"].pop("drift_mm_per_s", None)
        older.append(json.dumps(message, separators=(",", ":")))
    path.write_text("\n".join([first, watch, *older]) + "\n")
    replayed = list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))
    assert len(replayed) == 20
    assert [cycle.where for cycle in replayed if cycle.differs] == []


def test_a_gauge_that_fails_on_the_move_costs_what_it_always_did():
    live = quick(machine())
    moving(live, cycles=3)
    live.faults["scale_2.position"] = Quality.LINE_LOST
    assert "scale 2" in live.step().reason
