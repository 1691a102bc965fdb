"""Effects in the live loop: adopted, refused, shadowed, faded, told; the clock is a number, the daemon is real."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compd.cli.measurements.model.adopt import adopt
from compd.cli.measurements.model.shadow import shadow
from compd.client import connect
from compd.errors import CompdError, DaemonError, StateError
from compd.gauge import Quality
from compd.live import daemon as daemon_module
from compd.live.daemon import Daemon
from compd.live.loop.commands import Target
from compd.live.loop.cycle import step
from compd.live.loop.ring_entries import CyclePacker, CycleUnpacker, Directions
from compd.live.machine.model_loader import Models
from compd.live.service.readings_message import ReadingsMessage, parse_readings
from compd.setpoint_states import State
from tests.support.live_machine import HOLD_S, PERIOD_S, STEP_MM, machine
from tests.support.live_models import file_with, thermal, warm, with_noise
from tests.unit.live.test_daemon import StillGauges, configuration, first, running

LINK_ZERO_UM = np.array([40.0, -25.0, 10.0])
WARM_degC = 23.0


@pytest.fixture
def tripod():
    return machine()


@pytest.fixture
def still(monkeypatch):
    monkeypatch.setattr(daemon_module, "Acquisition", StillGauges)


def test_a_model_is_adopted_between_two_ticks_slewing_never_jumping(tripod, tmp_path):
    file = file_with(tmp_path / "m.yaml", "link_zero", "tool_offset", link_zero=LINK_ZERO_UM, tool_offset=[3, -2, 5])
    before = tripod.settle()
    tripod.commands.models = Models(tripod.loader.read(file))
    setpoints = [before]
    while len(setpoints) < 200 and (len(setpoints) < 3 or setpoints[-1].state is not State.OK):
        setpoints.append(tripod.step())
    assert setpoints[1].state is State.SLEWING
    assert setpoints[-1].state is State.OK
    corrections = np.array([setpoint.values.correction_mm for setpoint in setpoints])
    assert np.abs(np.diff(corrections, axis=0)).max() <= STEP_MM + 1e-12
    tips = np.array([setpoint.values.tip_M_mm for setpoint in setpoints])
    assert np.linalg.norm(np.diff(tips, axis=0), axis=1).max() <= 5 * STEP_MM, "nor does the tip that is told"
    assert np.linalg.norm(tips[-1] - tips[0]) > 0.02
    sources = setpoints[-1].values.contributions
    assert list(sources) == ["joints", "frame", "link_zero", "tool_offset"]
    assert sources["link_zero"] == pytest.approx(-LINK_ZERO_UM * 1e-3, abs=1e-9)
    assert sum(sources.values()) == pytest.approx(setpoints[-1].values.correction_mm, abs=1e-12)
    assert (before.model, setpoints[1].model) == ("", tripod.commands.models.applied.hash)
    tripod.commands.models = None
    assert tripod.settle().values.correction_mm == pytest.approx(np.zeros(3), abs=1e-12)


def test_in_machine_tool_mode_the_scale_setpoint_slews_to_the_new_model(tripod, tmp_path):
    file = file_with(tmp_path / "m.yaml", "link_zero", link_zero=LINK_ZERO_UM)
    tripod.commands.target = Target((5.0, -3.0, -505.0))
    before = tripod.settle()
    tripod.commands.models = Models(tripod.loader.read(file))
    first_ = tripod.step()
    moved_mm = first_.values.scale_setpoint_mm - before.values.scale_setpoint_mm
    assert np.abs(moved_mm).max() == pytest.approx(STEP_MM)
    after = tripod.settle()
    moved_mm = after.values.scale_setpoint_mm - before.values.scale_setpoint_mm
    assert moved_mm == pytest.approx(-LINK_ZERO_UM * 1e-3, abs=1e-9)
    assert after.values.tip_B0_mm == pytest.approx([5.0, -3.0, -505.0])


FORMULA = {
    "id": "swelling",
    "port": "link",
    "formula": "k * (humidity_pct - 50)",
    "parameters": {"k": {"unit": "um", "plausible": [-1, 1], "source": "notes"}},
}
FORMULA_OF_TIP = {**FORMULA, "id": "bow", "formula": "k * lag(tip_y_mm, 2)"}
IN_TIME = {**FORMULA, "id": "creep", "formula": "k * time_s"}
NAMED_AS_A_PART = {**FORMULA, "id": "frame", "formula": "k * tip_x_mm"}


@pytest.mark.parametrize(
    ("declared", "text"),
    [
        ("link_elasticity", "wire a force gauge under `wiring: quantities:` as `name: force_z_N`"),
        (FORMULA, "wire a hygrometer under `wiring: quantities:` as `name: humidity_pct`"),
        (IN_TIME, "reads time_s, which counts from the start of a recording"),
        (NAMED_AS_A_PART, "has the name of a part of the correction"),
    ],
    ids=["force", "formula", "time", "name"],
)
def test_an_effect_that_cannot_run_here_is_refused_with_what_to_do(tripod, tmp_path, declared, text):
    with pytest.raises(StateError) as caught:
        tripod.loader.read(file_with(tmp_path / "m.yaml", declared, "link_zero"))
    assert text in str(caught.value)


def test_every_problem_is_told_at_once_and_a_file_of_another_machine_refused(tripod, tmp_path):
    with pytest.raises(StateError) as caught:
        tripod.loader.read(file_with(tmp_path / "m.yaml", "link_elasticity", "link_zero", IN_TIME, link_zero=np.nan))
    problems = str(caught.value)
    for part in ("force_x_N", "force_y_N", "force_z_N", "time_s", "effect link_zero: has a parameter"):
        assert part in problems
    with pytest.raises(StateError, match="belongs to another machine"):
        tripod.loader.read(file_with(tmp_path / "other.yaml", "link_zero", name="hexapod", links=6))
    with pytest.raises(StateError, match="cannot be read"):
        tripod.loader.read(tmp_path / "none.yaml")


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("value: 1.0", "value: one", "is no number"),
        ("effects:", "effects: 5\nothers:", "is no list"),
        ("covariance:", "covariance: [[1], [2, 3]]\nothers:", "is no matrix of numbers"),
        ("machine: tripod-cmm", "machine: tripod-cmm\ngeometry: 0123", "another geometry of this machine"),
    ],
)
def test_a_damaged_model_file_is_refused_in_words(tripod, tmp_path, old, new, text):
    file = file_with(tmp_path / "m.yaml", "link_sag")
    assert tripod.loader.read(file).summary["effects"] == ["link_sag"]
    assert old in file.read_text()
    without_checksum, _, _ = file.read_text().partition("checksum:")
    file.write_text(without_checksum.replace(old, new))
    with pytest.raises(StateError, match=text):
        tripod.loader.read(file)


def test_an_effect_of_faulty_code_is_refused_before_the_loop_meets_it(tripod, tmp_path):
    code = tmp_path / "mine.py"
    code.write_text(
        "from dataclasses import replace\n"
        "from compd.model.library import load_library\n"
        "def basis(rows, shape, memory):\n    return rows.scale_mm[:, :2, None], memory\n"
        "MINE = replace(load_library()['link_sag'], id='mine', basis=basis)\n"
    )
    code.chmod(0o644)
    with pytest.raises(StateError, match="an effect fails: ValueError"):
        tripod.loader.read(file_with(tmp_path / "m.yaml", f"{code}:MINE"))


def test_effects_at_the_reference_are_told_as_not_live(tripod, tmp_path):
    model = tripod.loader.read(file_with(tmp_path / "m.yaml", "reference_drift", "link_zero"))
    assert model.summary["effects"] == ["link_zero"]
    assert model.summary["not_live"] == ["reference_drift"]


def test_a_thermometer_that_an_effect_uses_belongs_to_the_set(tmp_path):
    live = machine(on_stale="hold")
    live.settle()
    warm(live, WARM_degC)
    live.faults["cabinet.link_2"] = Quality.SENSOR_FAULT
    assert live.step().state is State.OK, "nothing uses it yet"
    live.faults.clear()
    live.commands.models = thermal(live, tmp_path)
    good = live.settle()
    assert np.abs(good.values.contributions["link_expansion"]).min() > 0.01
    live.faults["cabinet.room"] = Quality.SENSOR_FAULT
    assert live.step().state is State.OK, "no effect uses the room's"
    live.faults["cabinet.link_2"] = Quality.SENSOR_FAULT
    held = live.step()
    assert held.state is State.HOLD
    assert "temperature_link_2_degC (cabinet.link_2): sensor_fault" in held.reason
    assert held.values.correction_mm == pytest.approx(good.values.correction_mm)
    live.now_s += HOLD_S
    assert live.step().state is State.STOP


def test_fading_takes_the_effects_back_too(tmp_path):
    live = machine(on_stale="fade")
    warm(live, WARM_degC)
    live.commands.models = thermal(live, tmp_path)
    good = live.settle()
    live.faults["cabinet.link_1"] = Quality.TIMEOUT
    live.step()
    for _ in range(round(0.5 * HOLD_S / PERIOD_S)):
        half = live.step()
    assert half.state is State.FADE
    assert half.values.correction_mm == pytest.approx(0.5 * good.values.correction_mm, rel=0.02)


def test_a_model_that_needs_more_than_the_last_good_set_has_waits_for_a_new_one(tmp_path):
    live = machine(on_stale="hold")
    live.settle()
    live.faults["joints.1"] = Quality.TIMEOUT
    assert live.step().state is State.HOLD
    live.commands.models = thermal(live, tmp_path)
    waiting = live.step()
    assert (waiting.state, waiting.valid) == (State.STARTING, False)
    live.faults.clear()
    assert live.settle().valid


def test_a_shadow_changes_nothing_and_tells_what_it_would_do(tmp_path):
    alone, beside = machine(), machine()
    warm(beside, WARM_degC)
    models = Models(beside.loader.without_effects, thermal(beside, tmp_path).applied)
    beside.commands.models = models
    for tick in range(20):
        for live in (alone, beside):
            live.change_mm["joints.4"] = 0.001 * (tick % 5)
        plain, both = alone.step(), beside.step()
        assert both.values.correction_mm.tobytes() == plain.values.correction_mm.tobytes()
        assert both.values.tip_M_mm.tobytes() == plain.values.tip_M_mm.tobytes()
        assert (both.state, both.model, list(both.values.contributions)) == (plain.state, "", ["joints", "frame"])
    shadow_result = both.shadow
    assert shadow_result.model == models.shadow.hash
    difference_mm = shadow_result.correction_mm - sum(both.values.contributions.values())
    expected_mm = -10e-6 * (WARM_degC - 20.0) * both.values.link_length_mm
    assert difference_mm == pytest.approx(expected_mm, rel=1e-3)
    beside.faults["cabinet.link_1"] = Quality.TIMEOUT
    lost = beside.step()
    assert lost.state is State.OK, "the applied model does not need it"
    assert "temperature_link_1_degC" in lost.shadow.reason
    assert lost.shadow.correction_mm is None
    assert b'"shadow":{"model":' in lost.to_json()


def test_what_a_shadow_has_learnt_of_the_past_is_kept_when_it_is_adopted(tmp_path):
    live = machine()
    model = thermal(live, tmp_path, "link_expansion_lag").applied
    live.commands.models = Models(live.loader.without_effects, model)
    live.settle()
    warm(live, WARM_degC)
    live.now_s += 30.0  # half the time constant of 60 s after the step
    before = live.step().shadow
    share = (before.correction_mm / (-10e-6 * 3.0 * live.settle().values.link_length_mm)).mean()
    assert 0.1 < share < 0.5, "the rods lag behind"
    live.commands.models = Models(model)
    after = live.settle()
    assert after.values.contributions["link_expansion_lag"] == pytest.approx(before.correction_mm, rel=0.1)


def test_cycles_with_effects_and_a_shadow_replay_bit_for_bit(tmp_path):
    live, again = (with_noise(machine(on_stale="fade"), 0.1) for _ in range(2))
    one = live.loader.read(file_with(tmp_path / "one.yaml", "link_expansion_lag", "backlash", backlash=[20, 30, 40]))
    two = live.loader.read(file_with(tmp_path / "two.yaml", "friction_hysteresis", FORMULA_OF_TIP))
    transcript = ReadingsMessage(live.wires, live.latest.channels)
    packer = CyclePacker(Directions(live.wires.scale.wires))
    commands = {
        0: None,
        20: Models(one),
        60: Models(one, two),
        120: Models(two),
        170: Models(live.loader.without_effects),
    }
    states = set()
    for tick in range(200):
        live.commands.models = commands.get(tick, live.commands.models)
        live.commands.target = Target((0.0, 0.01 * tick, -510.0)) if 90 < tick < 140 else None
        live.faults = {"joints.2": Quality.TIMEOUT} if 140 < tick < 150 else {}
        live.change_mm["scale_1.position"] = 0.01 * min(tick % 40, 40 - tick % 40)
        sent = live.step()
        states.add(sent.state)
        read = parse_readings(
            json.loads(transcript.line(CycleUnpacker().unpack(packer.pack(sent, sent.to_json())))), live.latest.channels
        )
        models = sent.inputs.models or again.settings.without_effects
        replayed, _ = step(read.state._replace(models=models), read.inputs._replace(models=models), again.settings)
        assert replayed.to_json() == sent.to_json(), tick
    assert {State.OK, State.SLEWING, State.FADE} <= states


@pytest.mark.usefixtures("still")
def test_a_running_daemon_is_asked_told_and_refuses(tmp_path, capsys):
    configured = configuration(tmp_path)
    file = file_with(tmp_path / "m.yaml", "link_zero", link_zero=LINK_ZERO_UM)
    with running(configured) as (daemon, client):
        client.zero()
        assert client.model()["applied"] == {"effects": []}
        setpoints = client.watch()
        assert "model" not in first(setpoints, "ok")
        shadow(file, configured.sockets.unix.path)
        beside = next(s for s in setpoints if "shadow" in s)
        assert beside["shadow"]["correction_mm"] == pytest.approx(-LINK_ZERO_UM * 1e-3, abs=1e-5)
        assert beside["correction_mm"] == pytest.approx([0, 0, 0], abs=1e-9)
        adopt(file, configured.sockets.unix.path)
        printed = capsys.readouterr().out
        assert f"applied: {file} (" in printed
        keep = f"to keep it, write `model_file: {file}` under `state:` in {configured.path}"
        assert f"not kept over a restart; {keep}" in printed
        done = next(s for s in setpoints if s.get("model") and s["state"] == "ok")
        assert done["sources_mm"]["link_zero"] == pytest.approx(-LINK_ZERO_UM * 1e-3, abs=1e-5)
        assert "shadow" not in done, "the shadow is what is applied now"
        assert client.status()["model"]["applied"]["model"] == done["model"]
        with pytest.raises(DaemonError, match="wire a force gauge"):
            client.model(str(file_with(tmp_path / "force.yaml", "link_elasticity")))
        with pytest.raises(DaemonError, match="cannot be read: No such file"):
            client.model("none.yaml")
        with (
            connect(f"127.0.0.1:{daemon.listeners.tcp_port}") as other,
            pytest.raises(DaemonError, match="Unix socket"),
        ):
            other.model()
        assert client.model()["applied"]["model"] == done["model"], "what was refused has changed nothing"
        adopt(None, configured.sockets.unix.path, none=True)
        kept = {"kept": True, "kept_text": "kept over a restart"}
        assert client.model() == {"class": "MODEL", "applied": {"effects": []}, **kept}


@pytest.mark.usefixtures("still")
def test_the_configuration_says_with_which_model_the_daemon_starts(tmp_path):
    configured = configuration(tmp_path)

    def starting_with(file: Path):
        return replace(configured, state=configured.state.model_copy(update={"model_file": str(file)}))

    with running(starting_with(file_with(tmp_path / "m.yaml", "link_zero"))) as (_, client):
        assert client.model()["applied"]["effects"] == ["link_zero"]
    with pytest.raises(CompdError, match="wire a force gauge"):
        Daemon(starting_with(file_with(tmp_path / "force.yaml", "link_elasticity")))
    with pytest.raises(CompdError, match="cannot be read"):
        Daemon(starting_with(tmp_path / "none.yaml"))
