"""A cycle on the move: the tip at the cycle's own time, its uncertainty, and the same bytes again in a replay."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from compd.compensation import GaugeValues
from compd.gauge import Quality, ReadingMotion, bad, good
from compd.live.loop.commands import Target
from compd.live.loop.tip_uncertainty import stated_noise, tip_uncertainty
from compd.live.record.replay import RecordedCycles, replay_cycles
from compd.live.service.message_keys.readings import ReadingsKeys
from compd.live.service.state_json import to_plain
from compd.model import EffectMemory
from compd.setpoint_states import State
from tests.support.live_machine import RAW_AT_ZERO_MM, machine
from tests.support.live_models import with_noise
from tests.support.recorded_run import Run

SPEED_MM_PER_S = 50.0
AGES_S = {"scale_1.position": 0.02, "scale_2.position": 0.05, "scale_3.position": 0.01, "joints.4": 0.17}
SPEEDS = {"scale_1.position": 50.0, "scale_2.position": -30.0, "scale_3.position": 10.0, "joints.4": 0.05}


def unlimited(name="tripod-cmm.yaml", **changes):
    """The machine without a limit of the tip's error."""
    return machine(name, tip_error_um=None, **changes)


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
            motion = ReadingMotion(speed, 0.0, u, horizon_s, speed, 0.01, 1.0) if channel in live.change_mm else None
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
    setpoint = moving(quick(unlimited()), cycles=20)
    truth = at_once(quick(unlimited()), setpoint.time_s)
    as_read = moving(quick(unlimited()), cycles=20, extrapolate=False)
    assert setpoint.values.tip_M_mm == pytest.approx(truth.values.tip_M_mm, abs=1e-9)
    assert setpoint.values.correction_mm == pytest.approx(truth.values.correction_mm, abs=1e-9)
    assert np.linalg.norm(as_read.values.tip_M_mm - truth.values.tip_M_mm) > 0.5


def test_age_and_skew_stay_those_of_the_measurements():
    setpoint = moving(unlimited())
    assert setpoint.age_s == pytest.approx(0.17)
    assert setpoint.skew_s == pytest.approx(0.169)


def test_readings_without_a_motion_are_used_as_they_are():
    live = quick(unlimited())
    moving(live)
    still = quick(unlimited())
    still.change_mm["scale_1.position"] = 1.0
    assert still.step().values.scale_setpoint_mm == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)


def test_the_bound_grows_with_age_and_is_larger_where_nothing_is_carried_on():
    at_rest = with_noise(unlimited(), 0.1).step().u_tip_um
    carried, as_read = (
        moving(with_noise(unlimited(), 0.1), extrapolate=extrapolate).u_tip_um for extrapolate in (True, False)
    )
    assert at_rest < carried < as_read - 1500.0, "50 mm/s for 0.02 s and 30 mm/s for 0.05 s are not carried on"


@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_the_bound_by_age_is_that_of_the_worst_signs_of_the_scales(name):
    live, step_mm = with_noise(unlimited(name), 0.1), 1e-3
    bound_um = moving(live).u_tip_um - 1.2 * live.state.tip_noise_um[3]
    lengths_mm, _ = live.wires.lengths.age_bound_mm(live.latest.snapshot(live.now_s), live.model.links, True, 0.4)
    moved = []
    for channel in live.wires.length_channels:
        pair = []
        for sign in (1, -1):
            changed = quick(unlimited(name))
            changed.change_mm[channel] += sign * step_mm
            pair.append(changed.step().values.tip_M_mm)
        moved.append(1e3 * (pair[0] - pair[1]) / (2 * step_mm))
    by_length_um = np.array(moved) * lengths_mm[:, None]
    links = live.model.links
    signs = itertools.product((1, -1), repeat=links)
    furthest_um = max(np.linalg.norm(np.array(each) @ by_length_um[:links]) for each in signs)
    others_um = np.sqrt((by_length_um[links:] ** 2).sum())
    assert bound_um == pytest.approx(furthest_um + others_um, rel=0.05)


def test_the_age_of_the_scales_does_not_count_where_they_are_not_used():
    live = with_noise(unlimited(), 0.1)
    tip_mm = tuple(live.step().values.tip_B0_mm.tolist())
    live.commands.target = Target(tip_mm)
    bound_um = moving(live, extrapolate=False).u_tip_um
    assert bound_um < 500.0, "the joints alone: the oldest is 0.17 s old"


def test_a_motion_that_is_not_known_yet_leaves_the_bound_unknown_and_is_named_with_a_limit():
    setpoint = moving(with_noise(unlimited(), 0.1), u=float("nan"))
    assert setpoint.valid
    assert "u_tip_um" not in json.loads(setpoint.to_json())
    refused = moving(with_noise(unlimited(), 0.1, tip_error_um=100.0), u=float("nan"))
    assert refused.state is State.REFUSED
    assert "scale 1 (scale_1.position), scale 2 (scale_2.position)" in refused.reason
    assert "read only once" in refused.reason


def test_a_silent_gauge_is_held_where_it_was_carried_to():
    live = quick(unlimited())
    first = moving(live, horizon_s=0.1)
    tips = []
    for _ in range(40):
        live.now_s += 0.005
        tips.append(live.run_cycle().values.tip_M_mm)
    assert tips[-1] == pytest.approx(tips[-10], abs=1e-9)
    assert np.linalg.norm(tips[-1] - first.values.tip_M_mm) > 1.0


def standing(live):
    """The setpoint a second later, when all have stood still, and their readings scatter."""
    return later(live, 0.0)


def held(live, elsewhere_mm=0.0):
    """Likewise, when joint 4 is lost, and scale 1 stands elsewhere."""
    setpoint = later(live, elsewhere_mm, lost=True)
    assert setpoint.state is State.HOLD
    return setpoint


def later(live, elsewhere_mm, lost=False):
    live.now_s += 1.0
    live.tick += 1
    for channel, slot in live.latest.index.items():
        moved_mm = elsewhere_mm if channel == "scale_1.position" else 0.0
        fresh = good(RAW_AT_ZERO_MM + moved_mm if channel in live.change_mm else 20.0, live.now_s)
        motion = ReadingMotion(0.0, 0.0, 1e-3, 1.0, 0.0, 0.01, 1.0) if channel in live.change_mm else None
        live.latest.put(slot, fresh._replace(motion=motion))
    if lost:
        live.latest.put(live.latest.index["joints.4"], bad(live.now_s, Quality.TIMEOUT))
    return live.run_cycle()


def test_the_bound_grows_while_a_set_of_comparators_is_held():
    live = with_noise(unlimited(on_stale="hold"), 0.1)
    live.change_mm = dict.fromkeys(live.change_mm, 0.0)
    standing(live)
    at_rest_um = standing(live).u_tip_um
    bounds_um = [held(live).u_tip_um for _ in range(3)]
    assert at_rest_um < bounds_um[0] < bounds_um[1] < bounds_um[2]
    assert bounds_um[2] < 100.0, "nothing moves but by what the last readings leave open"


def test_what_joints_and_frame_may_do_counts_while_a_set_is_held_and_the_machine_moves():
    live = with_noise(unlimited(on_stale="hold"), 0.1)
    standing(live)
    still_um = held(live).u_tip_um
    live = with_noise(unlimited(on_stale="hold"), 0.1)
    standing(live)
    moved_um = held(live, elsewhere_mm=5.0).u_tip_um
    assert moved_um > still_um + 100.0


def test_a_set_held_before_its_motion_is_known_leaves_the_bound_unknown():
    live = with_noise(unlimited(on_stale="hold"), 0.1)
    moving(live, u=float("nan"))
    assert "u_tip_um" not in json.loads(held(live).to_json())


def test_a_held_set_replays_bit_for_bit(tmp_path):
    run = Run(with_noise(unlimited(on_stale="hold"), 0.1))
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
    run = Run(with_noise(unlimited(), 0.1))
    sent = []
    with run.recorder(tmp_path / "run") as recorder:
        for k in range(30):
            setpoint = moving(run.machine, u=0.5 if k else float("nan"))
            line, message, _ = run.recorded(setpoint)
            recorder.put(line, message)
            sent.append(setpoint.to_json())
    assert len(set(sent)) == 30
    ReadingsKeys.model_validate_json(json.dumps({key: message[key] for key in message if key != "class"}))
    assert message["readings"]["scale_1.position"]["motion"]["speed_mm_per_s"] == SPEED_MM_PER_S
    replayed = list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))
    assert [cycle.replayed for cycle in replayed] == sent
    table = (tmp_path / "run-0001.csv").read_text().splitlines()
    assert dict(zip(table[0].split(","), table[-1].split(","), strict=True))["skew_s"] == "0.169"


def former_um(live):
    """(3,) as releases up to 0.2.0 told it: with one reading for each length, while no effect is applied."""
    noise = stated_noise(live.configuration, live.wires, readings=1)
    zeros = GaugeValues(np.zeros(3), np.zeros(9), np.zeros(9), {}, 0.0)
    return tip_uncertainty(live.model, noise, zeros, np.zeros(3), EffectMemory()).by_noise_um[:3]


def test_a_recording_of_a_release_without_motion_replays_as_it_was(tmp_path):
    """As 0.2.0 wrote them: no motion, no skew, the tip's standard uncertainty along x, y, z in setpoint and state."""
    run = Run(with_noise(unlimited(), 0.1, tip_error_um=100.0))
    with run.recorder(tmp_path / "run") as recorder:
        for line, message, _ in run.quiet(20):
            recorder.put(line, message)
    path = tmp_path / "run-0001.cycles.jsonl"
    first, watch, *cycles = path.read_text().splitlines()
    older = []
    for cycle in cycles:
        message = json.loads(cycle)
        del message["setpoint"]["skew_s"]
        carried = message["carried"]
        carried.pop("tip_by_gauge", None)
        former = former_um(run.machine)
        carried["u_tip_um"] = to_plain(former) if carried.pop("tip_noise_um") else {}
        if message["setpoint"]["valid"]:
            message["setpoint"]["u_tip_um"] = former.round(4).tolist()
        for name in ("length_times_s", "drift_mm_per_s", "scale_mm"):
            carried["last_good"].pop(name, None)
        older.append(json.dumps(message, separators=(",", ":")))
    path.write_text("\n".join([first, watch, *older]) + "\n")
    replayed = list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))
    assert len(replayed) == 20
    assert [cycle.where for cycle in replayed if cycle.differs] == []


def test_a_gauge_that_fails_on_the_move_costs_what_it_always_did():
    live = quick(unlimited())
    moving(live, cycles=3)
    live.faults["scale_2.position"] = Quality.LINE_LOST
    assert "scale 2" in live.step().reason
