"""Cycles of `machine: external` without lines: limits, a class that fails, and a recording that is replayed."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
import yaml

import compd
from compd.errors import StateError
from compd.gauge import Quality
from compd.live.loop import Target
from compd.live.loop.limits import limit_pose_correction
from compd.live.loop.packet_layout import BODY, PACKET_BODY
from compd.live.machine import Models
from compd.live.record.compared_table import differing_cells
from compd.live.record.replay import Agreement, RecordedCycles, replay_cycles
from compd.machine_check import load_whole
from compd.operation_settings import LimitSettings
from compd.setpoint_states import State
from tests.support.external_machines import GANTRY, class_geometry, external_yaml
from tests.support.live_machine import Machine
from tests.support.live_models import file_with
from tests.support.recorded_run import Run

X, Y, Z = "plc.x", "plc.y", "plc.z"
BAD_BEYOND_50 = GANTRY.replace("x, y, z = scale_mm", "x, y, z = scale_mm\n        if x > 50:\n            return [x]")
# The gantry is less square than the class says: along y, so much of x.
SQUARE = {
    "id": "square",
    "physics": "the axes are less square than the class says",
    "port": "reference",
    "sensitivity": "square",
    "parameters": {"square": {"unit": "um/mm", "plausible": [-10, 10], "source": "a guess"}},
}
SHIFT = {
    "id": "scale_shift",
    "physics": "scales were shifted",
    "port": "scale",
    "formula": "k",
    "parameters": {"k": {"unit": "um", "plausible": [-1000, 1000], "source": "a guess"}},
}
LIMITS = {"correction_mm": 0.2, "slew_mm_per_s": 1000.0, "on_limit": "clamp"}


def gantry(folder: Path, text: str = GANTRY, **changed) -> Machine:
    return Machine(load_whole(external_yaml(folder, class_geometry(folder, text), **changed)))


def with_effect(live: Machine, folder: Path, effect, **theta) -> Machine:
    links = live.configuration.geometry.links
    file = file_with(folder / "model.yaml", effect, name="external", links=links, **theta)
    live.commands.models = Models(live.loader.read(file))
    return live


def test_what_the_class_gives_is_read_by_an_effect(tmp_path):
    live = with_effect(gantry(tmp_path, limits=LIMITS), tmp_path, SQUARE, square=0.002)
    live.change_mm |= {X: 40.0, Y: 7.0}
    setpoint = live.step()
    assert setpoint.state is State.OK
    assert setpoint.values.tip_M_mm == pytest.approx([40.0, 7.04 + 0.08, 300.0], abs=1e-9)
    assert setpoint.values.pose_correction[:3] == pytest.approx([0, -0.08, 0], abs=1e-9)


def test_a_correction_beyond_its_limit_has_the_tip_that_belongs_to_what_is_applied(tmp_path):
    live = with_effect(gantry(tmp_path, limits=LIMITS), tmp_path, SHIFT, scale_shift=300.0)
    setpoint = live.step()
    assert setpoint.state is State.CLAMPED
    assert setpoint.values.correction_mm == pytest.approx([-0.2] * 3, abs=1e-12)
    assert setpoint.values.tip_M_mm == pytest.approx([0.2, 0.2 + 0.2e-3, 299.8], abs=1e-6)
    pose = setpoint.values.tip_M_mm + setpoint.values.pose_correction[:3]
    assert pose == pytest.approx([0, 0, 300], abs=1e-9)


def test_a_clamped_correction_of_a_commanded_pose_is_what_the_scales_may_do(tmp_path):
    yaml = external_yaml(tmp_path, {"kinematics": "client", "links": 2}, limits=LIMITS)
    live = with_effect(Machine(load_whole(yaml)), tmp_path, SHIFT, scale_shift=300.0)
    rows = ((1.0, 0.0), (0.0, 2.0), (0.0, 0.0))
    live.commands.target = Target((1.0, 2.0, 3.0), tip_by_scale=rows)
    setpoint = live.step()
    assert setpoint.state is State.CLAMPED
    assert setpoint.values.tip_M_mm.tolist() == [1, 2, 3]
    assert setpoint.values.pose_correction[:3] == pytest.approx([-0.2, -0.4, 0], abs=1e-12)


def limited(wanted, previous=(0.0,) * 6, period_s=1.0, **limits):
    settings = LimitSettings(**{**LIMITS, **limits})
    return limit_pose_correction(np.array(wanted), np.array(previous), period_s, settings)


def test_a_rotation_is_limited_as_the_length_by_which_it_moves_a_point():
    own = {"tip_correction_mm": 0.1, "rotation_correction_rad": 0.002}
    within = limited([0.05, 0, 0, 0, 0, 0.0015], **own)
    assert (within.state, within.applied_mm.tolist()) == (State.OK, [0.05, 0, 0, 0, 0, 0.0015])
    beyond = limited([0, 0, 0, 0, 0, -0.003], **own)
    assert beyond.state is State.CLAMPED
    assert beyond.applied_mm == pytest.approx([0, 0, 0, 0, 0, -0.002], abs=1e-15)
    assert "rotation c: correction -0.150 mm beyond -0.100 mm, clamped" in beyond.reason
    assert limited([0, 0, 0, 0, 0, 0.0019]).state is State.OK, "0.2 mm at 100 mm, where the limits do not say"
    assert limited([0, 0, 0, 0, 0, 0.0021]).state is State.CLAMPED


def test_a_correction_of_a_pose_slews_and_keeps_a_rotation_that_is_not_known():
    slewing = limited([0.1, 0, 0, math.nan, math.nan, math.nan], period_s=0.05, slew_mm_per_s=1.0)
    assert slewing.state is State.SLEWING
    assert slewing.applied_mm[:3] == pytest.approx([0.05, 0, 0], abs=1e-15)
    assert np.isnan(slewing.applied_mm[3:]).all()
    known_again = limited([0.1, 0, 0, 0, 0, 0], slewing.applied_mm)
    assert known_again.applied_mm.tolist() == [0.1, 0, 0, 0, 0, 0]
    refused = limited([0.3, 0, 0, 0, 0, 0], [0.1, 0, 0, 0, 0, 0], on_limit="refuse")
    assert (refused.state, refused.applied_mm.tolist()) == (State.REFUSED, [0.1, 0, 0, 0, 0, 0])


@pytest.mark.parametrize("port", ["frame", "base_joint", "tool"])
def test_a_model_with_an_effect_inside_the_kinematics_is_refused(tmp_path, port):
    inside = {**SHIFT, "id": "inside", "port": port, "axis": "z"}
    if port == "frame":
        inside.pop("axis")
    with pytest.raises(StateError, match=f"acts at the port {port}"):
        with_effect(gantry(tmp_path), tmp_path, inside)


def test_a_recording_replays_bit_for_bit_with_refused_and_clamped_cycles(tmp_path):
    live = with_effect(gantry(tmp_path, BAD_BEYOND_50, limits=LIMITS), tmp_path, SHIFT, scale_shift=300.0)
    run = Run(live)
    sent = []
    with run.recorder(tmp_path / "run") as recorder:
        for number, (line, message, setpoint) in enumerate(run.quiet(60)):
            live.change_mm[X] = 60.0 if 20 < number < 30 else float(number) / 3
            recorder.put(line, message)
            sent.append(setpoint)
    assert {State.CLAMPED, State.REFUSED} <= {setpoint.state for setpoint in sent}
    assert "Gantry.pose: gives no such numbers" in next(s.reason for s in sent if s.state is State.REFUSED)
    replayed = list(replay_cycles(live.configuration, RecordedCycles(tmp_path / "run"), [tmp_path / "model.yaml"]))
    assert [cycle.replayed for cycle in replayed] == [setpoint.to_json() for setpoint in sent]
    assert {cycle.agreement for cycle in replayed} == {Agreement.SAME}
    assert not list(differing_cells(RecordedCycles(tmp_path / "run")))
    with next(tmp_path.glob("run-*.csv")).open() as file:
        rows = list(csv.DictReader(file))
    for row, setpoint in zip(rows, sent, strict=True):
        given = setpoint.values
        model_x = float(row["model_x_mm"] or "nan")
        expected = math.nan if given is None else float(row["scale_1_mm"])
        assert model_x == pytest.approx(expected, abs=2e-7, nan_ok=True)
        assert float(row["d_square_y_mm"] or "nan") == pytest.approx(expected, abs=1e-9, nan_ok=True)


def test_targets_of_a_client_are_recorded_with_their_derivatives(tmp_path):
    yaml = external_yaml(tmp_path, {"kinematics": "client", "links": 1}, limits=LIMITS)
    live = with_effect(Machine(load_whole(yaml)), tmp_path, SHIFT, scale_shift=30.0)
    run, sent = Run(live), []
    with run.recorder(tmp_path / "run") as recorder:
        for number, (line, message, setpoint) in enumerate(run.quiet(20)):
            live.commands.target = Target((1.0, 2.0, number), tip_by_scale=((0.3,), (0.1 * number,), (0.0,)))
            recorder.put(line, message)
            sent.append(setpoint.to_json())
    replayed = list(replay_cycles(live.configuration, RecordedCycles(tmp_path / "run"), [tmp_path / "model.yaml"]))
    assert [cycle.replayed for cycle in replayed] == sent
    assert b'"tip_correction_mm":[-0.009,' in sent[-1]


def test_a_recording_gives_a_model_with_which_the_live_error_falls(tmp_path):
    live, random = gantry(tmp_path, limits={**LIMITS, "correction_mm": 1.0}), np.random.default_rng(3)
    off_square = 0.8e-3

    def true_tip_mm():
        x, y, z = (live.change_mm[name] for name in (X, Y, Z))
        return np.array([x, y + (1e-3 + off_square) * x, 300.0 - z])

    def live_error_mm():
        live.change_mm |= dict(zip((X, Y, Z), random.uniform(-100, 100, 3), strict=True))
        return live.settle().values.tip_M_mm - true_tip_mm()

    run, truth = Run(live), []
    with run.recorder(tmp_path / "run") as recorder:
        for _ in range(80):
            live.change_mm |= dict(zip((X, Y, Z), random.uniform(-100, 100, 3), strict=True))
            line, message, _ = run.recorded(live.step())
            recorder.put(line, message)
            truth.append(true_tip_mm() + random.normal(0, 1e-3, 3))
    (recorded,) = tmp_path.glob("run-*.csv")
    with recorded.open(newline="") as file:
        rows = list(csv.DictReader(file))
    measured = tmp_path / "measured.csv"
    names = [f"reference_{axis}_mm" for axis in "xyz"]
    with measured.open("w", newline="") as file:
        writer = csv.DictWriter(file, [*rows[0], *names])
        writer.writeheader()
        writer.writerows(
            {**row, **dict(zip(names, tip.round(6), strict=True))} for row, tip in zip(rows, truth, strict=True)
        )
    reference = {"quantity": "tool_position", "frame": "machine", "sigma_um": 1.0}
    sidecar = yaml.safe_load(recorded.with_suffix(".yaml").read_text())
    measured.with_suffix(".yaml").write_text(yaml.safe_dump({**sidecar, "reference": reference}))

    before = max(np.abs(live_error_mm()).max() for _ in range(5))
    model = compd.add_effect(None, SQUARE, measured)
    model.write(tmp_path / "fitted.yaml")
    live.commands.models = Models(live.loader.read(tmp_path / "fitted.yaml"))
    after = max(np.abs(live_error_mm()).max() for _ in range(5))
    assert before > 0.02
    assert after < before / 20
    scales = {f"scale_{k}_mm": [live.change_mm[name]] for k, name in enumerate((X, Y, Z), start=1)}
    own = live.model.own
    np.testing.assert_allclose(model.predict(scales, own).tip_M_mm[0], live.settle().values.tip_M_mm, atol=1e-12)


def test_a_packet_has_the_correction_of_a_pose_where_no_links_are_corrected(tmp_path):
    live = Machine(load_whole(external_yaml(tmp_path, {"kinematics": "client"}, limits=LIMITS)))
    grown = {**SHIFT, "id": "growth", "port": "reference", "axis": "z"}
    with_effect(live, tmp_path, grown, growth=30.0)
    live.commands.target = Target((1.0, 2.0, 3.0), (0.0, 0.0, 0.1))
    packet = live.step().to_packet(bytes(8))
    names = [field.name for field in PACKET_BODY if field.name != "spare"]
    sizes = [
        int(field.format[:-1]) if field.format.endswith("d") and len(field.format) > 1 else 1
        for field in PACKET_BODY
        if field.name != "spare"
    ]
    values, found = list(BODY.unpack(packet[: BODY.size])), {}
    for name, size in zip(names, sizes, strict=True):
        found[name], values = values[:size], values[size:]
    assert found["links"] == [0]
    assert found["tip_mm"] == [1, 2, 3]
    assert found["correction_mm"] == pytest.approx([0, 0, -0.03, 0, 0, 0], abs=1e-12)
    assert np.isnan(found["scale_setpoint_mm"]).all()


GROWTH = {
    "id": "growth",
    "physics": "the spindle grows",
    "port": "reference",
    "axis": "z",
    "formula": "-k * (temperature_spindle_degC - 15)",
    "parameters": {"k": {"unit": "um/K", "plausible": [-100, 100], "source": "a guess"}},
}
SPINDLE = "plc.spindle"


def test_an_effect_without_a_number_is_named(tmp_path):
    endless = {**GROWTH, "formula": "k / (temperature_spindle_degC - 20)"}
    live = with_effect(gantry(tmp_path, limits=LIMITS), tmp_path, endless, growth=1.0)
    refused = live.step()
    assert refused.state is State.REFUSED
    assert "effect growth" in refused.reason


@pytest.mark.parametrize(
    ("geometry", "target"),
    [("class", None), ("client", Target((1.0, 2.0, 3.0))), ("client", Target((1.0, 2.0, 3.0), (0.0, 0.1, 0.0)))],
)
@pytest.mark.parametrize("on_stale", ["hold", "fade", "degrade", "stop"])
def test_a_thermometer_that_is_lost_is_treated_as_on_any_machine(tmp_path, geometry, target, on_stale):
    loop = {"rate_hz": 200, "stale_after_s": 0.5, "on_stale": on_stale, "hold_s": 0.5, "lock_memory": False}
    described = class_geometry(tmp_path) if geometry == "class" else {"kinematics": "client"}
    live = Machine(load_whole(external_yaml(tmp_path, described, limits=LIMITS, loop=loop)))
    with_effect(live, tmp_path, GROWTH, growth=4.0)
    live.commands.target = target
    full = live.settle().values.pose_correction[2]
    assert full == pytest.approx(0.02, abs=1e-12)
    live.faults[SPINDLE] = Quality.LINE_LOST
    states, corrections = [], []
    for _ in range(150):
        setpoint = live.step()
        states.append(setpoint.state)
        if setpoint.values is not None:
            corrections.append(setpoint.values.pose_correction[2])
            setpoint.to_json()
    assert states[0] is {"hold": State.HOLD, "fade": State.FADE, "degrade": State.FADE, "stop": State.STOP}[on_stale]
    assert states[-1] is (State.DEGRADED if on_stale == "degrade" else State.STOP)
    if on_stale == "hold":
        assert corrections == pytest.approx([full] * len(corrections), abs=1e-12)
    elif on_stale != "stop":
        assert corrections[-1] < 0.1 * full
        assert np.all(np.diff(corrections) <= 1e-12)


def test_a_shadow_runs_beside_the_applied_model_and_a_failing_class_hits_both(tmp_path):
    live = gantry(tmp_path, BAD_BEYOND_50, limits=LIMITS)
    grown = live.loader.read(file_with(tmp_path / "a.yaml", GROWTH, name="external", links=3, growth=4.0))
    other = live.loader.read(file_with(tmp_path / "b.yaml", GROWTH, name="external", links=3, growth=6.0))
    live.commands.models = Models(grown, other)
    shadow = live.settle().shadow
    assert shadow.tip_M_mm == pytest.approx([0, 0, 299.97], abs=1e-9)
    live.commands.models = Models(other)
    assert live.settle().values.tip_M_mm == pytest.approx([0, 0, 299.97], abs=1e-9)
    live.change_mm[X] = 60.0
    assert live.step().state is State.REFUSED
    live.change_mm[X] = 1.0
    assert live.settle().values.tip_M_mm[0] == pytest.approx(1.0, abs=1e-9)


def test_a_bound_of_the_tips_error_limits_a_pose_without_scales(tmp_path):
    limits = {**LIMITS, "tip_error_um": 5.0, "tip_correction_mm": 0.01}
    live = Machine(load_whole(external_yaml(tmp_path, {"kinematics": "client"}, limits=limits)))
    live.commands.target = Target((1.0, 2.0, 3.0))
    assert live.step().u_tip_um == pytest.approx(0.0, abs=1e-9), "nothing is measured, and nothing is corrected"
    with_effect(live, tmp_path, GROWTH, growth=4.0)
    refused = live.step()
    assert refused.state is State.REFUSED
    assert "what is not corrected" in refused.reason
