"""A recorded run replayed gives the setpoints that were sent, bit for bit; and a difference is seen."""

from __future__ import annotations

import json
import math
import os
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import typer

from compd.cli.measurements.recording.replay import replay as replay_command
from compd.configuration import load
from compd.errors import RecordingError, StateError
from compd.kernel_versions import versions_text_here
from compd.live.loop.cycle import step
from compd.live.machine.model_loader import Models
from compd.live.record.compared_table import differing_cells
from compd.live.record.replay import Agreement, RecordedCycles, replay_cycles
from compd.live.service.readings_message import parse_readings
from compd.live.service.state_json import from_plain, to_plain
from compd.model import EffectMemory
from compd.model.kinematics import Motion
from compd.setpoint_states import State
from tests.support.built_machines import drawing
from tests.support.live_machine import CONFIG, Machine, machine
from tests.support.live_models import file_with
from tests.support.recorded_run import ROOMY, Run
from tests.support.sampled import sampled

CYCLES = 400


def record(run, name, cycles, every=1):
    """Record every `every`-th of some eventful cycles; the setpoints that were sent."""
    sent = []
    with run.recorder(name) as recorder:
        for number, (line, message, setpoint) in enumerate(run.eventful(cycles)):
            if number % every == 0:
                recorder.put(line, message)
                sent.append(setpoint)
    return sent


@pytest.mark.parametrize(
    ("name", "on_stale", "on_limit"),
    sampled(product(["tripod-cmm.yaml", "hexapod.yaml"], ["hold", "fade", "stop"], ["clamp", "refuse"]), 7),
)
def test_a_recorded_run_replays_bit_for_bit(tmp_path, name, on_stale, on_limit):
    run = Run(machine(name, on_stale=on_stale, on_limit=on_limit), seed=11)
    sent = record(run, tmp_path / "run", CYCLES)
    replayed = list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))
    assert [cycle.sent for cycle in replayed] == [setpoint.to_json() for setpoint in sent]
    assert [cycle.replayed for cycle in replayed] == [setpoint.to_json() for setpoint in sent]
    lost = {"hold": State.HOLD, "fade": State.FADE, "stop": State.STOP}[on_stale]
    beyond = {"clamp": State.CLAMPED, "refuse": State.REFUSED}[on_limit]
    assert {State.OK, State.SLEWING, lost, beyond} <= {setpoint.state for setpoint in sent}
    assert {"cmm", "machine_tool"} == {setpoint.mode for setpoint in sent}


@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_a_csv_that_is_not_what_was_recorded_is_seen(tmp_path, name):
    """One bit of a digit, in any place, whether or not a column of the daemon's."""
    run = Run(machine(name), seed=11)
    with run.recorder(tmp_path / "run") as recorder:
        for line, message, _ in run.quiet(40):
            recorder.put(line, message)
    (table,) = tmp_path.glob("run-*.csv")
    assert list(differing_cells(RecordedCycles(tmp_path / "run"))) == []
    content = table.read_bytes()
    head = content.index(b"\n") + 1
    digits = [k for k in range(head, len(content)) if content[k : k + 1].isdigit()]
    for k in digits[:: len(digits) // 25]:
        table.write_bytes(content[:k] + bytes([content[k] ^ 1]) + content[k + 1 :])
        cells = list(differing_cells(RecordedCycles(tmp_path / "run")))
        assert cells, (k, content[k - 20 : k + 20])
        row = content[:k].count(b"\n") + 1
        assert f"{table}:{row}, " in cells[-1].where or "time_s" in cells[0].where


def test_replay_says_which_cell_of_the_csv_was_changed(tmp_path, capsys):
    run = Run(machine(), seed=11)
    with run.recorder(tmp_path / "run") as recorder:
        for line, message, _ in run.quiet(5):
            recorder.put(line, message)
    (table,) = tmp_path.glob("run-*.csv")
    lines = table.read_text().splitlines(keepends=True)
    cells = lines[3].split(",")
    recorded, cells[1] = cells[1], "0.5"
    table.write_text("".join([*lines[:3], ",".join(cells), *lines[4:]]))
    with pytest.raises(typer.Exit) as ended:
        replay_command(tmp_path / "run", run.machine.configuration.path)
    assert ended.value.exit_code == 1
    said = capsys.readouterr().err
    assert f"{table}:4, scale_1_mm was changed: 0.5, by the cycle {float(recorded)!r}" in said
    assert "the CSV is not what was recorded" in said


def test_a_recording_of_0_3_0_whose_setpoints_have_null_replays_bit_for_bit(tmp_path):
    run = Run(Machine(load(drawing("linear-delta", tmp_path))), seed=11)
    sent = record(run, tmp_path / "run", 60)
    path = tmp_path / "run-0001.cycles.jsonl"
    first, watch, *cycles = map(json.loads, path.read_text().splitlines())
    for message in cycles:
        if message["setpoint"]["valid"]:
            message["setpoint"] = {**message["setpoint"], "u_tip_um": None}
    lines = [json.dumps(message, separators=(",", ":")) for message in (first, watch, *cycles)]
    path.write_text("\n".join(lines) + "\n")
    replayed = list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))
    assert [cycle.replayed for cycle in replayed] == [setpoint.to_json() for setpoint in sent]
    assert [cycle.where for cycle in replayed if cycle.differs] == []
    assert any(setpoint.valid for setpoint in sent)


def test_a_thinned_recording_replays_bit_for_bit_too(tmp_path):
    run = Run(machine(), seed=5)
    sent = record(run, tmp_path / "run", CYCLES, every=20)
    replayed = list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))
    assert len(replayed) == CYCLES / 20
    assert [cycle.replayed for cycle in replayed] == [setpoint.to_json() for setpoint in sent]


def again_with(recorded, setpoint, settings):
    """The setpoint of a recorded cycle, computed again with the models of the first time."""
    models = setpoint.inputs.models or settings.without_effects
    again, _ = step(recorded.state._replace(models=models), recorded.inputs._replace(models=models), settings)
    return again


@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_no_bit_of_what_went_in_is_lost_on_the_way(name):
    """Stronger than setpoints, which are rounded and forgive a warm start that is not quite the same."""
    run, settings = Run(machine(name), seed=3), machine(name).settings
    for _, message, setpoint in run.eventful(300):
        recorded = parse_readings(message, run.machine.latest.channels)
        sent, read = setpoint.inputs, recorded.inputs
        assert repr(read.snapshot) == repr(sent.snapshot), "repr: a nan is not equal to itself"
        assert (read.zero, read.target) == (sent.zero, sent.target)
        before = setpoint.state_before
        assert (recorded.state.zero is read.zero) == (before.zero is sent.zero)
        assert to_plain(recorded.state._replace(zero=None)) == to_plain(before._replace(zero=None))
        again = again_with(recorded, setpoint, settings)
        assert again.to_packet(bytes(8)) == setpoint.to_packet(bytes(8)), "float64 that are not rounded"
        assert setpoint.valid is setpoint.state.valid


def test_what_effects_remember_goes_to_json_and_back():
    motion = Motion(1.5, *(np.array([0.1, np.nan, -0.0]) for _ in range(6)))
    memories = {"link.lag": (np.array([1e-300, 2.0]), np.array(3.0), np.arange(4.0).reshape(2, 2).T), "none": None}
    remembered = EffectMemory(motion, memories, commanded=True)
    read = from_plain(json.loads(json.dumps(to_plain(remembered), allow_nan=False)))
    assert isinstance(read, EffectMemory)
    assert isinstance(read.motion, Motion)
    assert (read.motion.time_s, read.commanded, read.memories["none"]) == (1.5, True, None)
    assert read.motion.direction.tobytes() == motion.direction.tobytes()
    for after, before in zip(read.memories["link.lag"], memories["link.lag"], strict=True):
        assert after.tolist() == before.tolist()
    for number in (math.nan, math.inf, -math.inf):
        assert repr(from_plain(to_plain(number))) == repr(number)
    with pytest.raises(TypeError, match="set cannot be carried"):
        to_plain({1})
    with pytest.raises(ValueError, match="no such state"):
        from_plain({"strange": 1})


def test_the_names_in_a_recording_stay_whatever_the_classes_are_called():
    run = Run(machine())
    _, message, _ = list(run.quiet(2))[-1]
    carried = message["carried"]
    names = {"kind", "zero", "warm", "correction_mm", "last_good", "scales_seen", "shadow", "adopting"}
    names |= {"tip_correction_mm", "tip_noise_um", "tip_by_gauge"}  # since 0.3.0
    assert set(carried) == names
    kinds = {name: carried[name]["kind"] for name in ("warm", "last_good", "shadow")}
    assert kinds == {"warm": "WarmStart", "last_good": "Comparators", "shadow": "Remembered"}
    assert carried["kind"] == "Carried"
    comparators = {"kind", "change_mm", "time_s", "oldest_s", "quantities"}
    since = {"length_times_s", "drift_mm_per_s", "scale_mm"}  # 0.3.0
    assert set(carried["last_good"]) == comparators | since


def test_a_cycle_without_zero_reads_back_as_it_was():
    run = Run(machine())
    run.machine.commands.zero = StateError.of("here", "machine zero has never been taken", next_step="take it")
    _, message, setpoint = run.recorded(run.machine.step())
    assert setpoint.state is State.NO_ZERO
    recorded = parse_readings(message, run.machine.latest.channels)
    assert recorded.setpoint_line == setpoint.to_json()
    assert repr(recorded.inputs.snapshot) == repr(setpoint.inputs.snapshot)
    again = again_with(recorded, setpoint, run.machine.settings)
    assert again.to_json() == setpoint.to_json()


def with_models(tmp_path):
    """A run in which a model with memory is adopted and another shadows it; its cycles' messages and setpoints."""
    run = Run(machine())
    loader = run.machine.loader
    lag = file_with(tmp_path / "lag.yaml", "link_expansion_lag", "friction_hysteresis")
    backlash = file_with(tmp_path / "backlash.yaml", "backlash")
    adopted = [None, Models(loader.read(lag)), Models(loader.read(lag), loader.read(backlash))]
    cycles = []
    for models in adopted:
        run.machine.commands.models = models
        cycles += run.eventful(60)
    return run, cycles, (lag, backlash)


def test_models_are_kept_with_the_recording_whatever_becomes_of_their_files(tmp_path, capsys):
    run, cycles, files = with_models(tmp_path)
    with run.recorder(tmp_path / "run", replace(ROOMY, part_bytes=300_000)) as recorder:
        for line, message, _ in cycles:
            recorder.put(line, message)
    for file in files:
        file.unlink()
    assert len(list(tmp_path.glob("run-*.csv"))) > 1
    replayed = list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))
    assert [cycle.replayed for cycle in replayed] == [setpoint.to_json() for _, _, setpoint in cycles]
    assert any(b'"shadow":{' in cycle.replayed for cycle in replayed)


def test_a_model_file_that_has_changed_since_is_told_and_may_be_given_later(tmp_path):
    run, cycles, (lag, backlash) = with_models(tmp_path)
    reports, adopted = [], lag.read_bytes()
    lag.write_bytes(adopted + b"# fitted again\n")
    backlash.unlink()
    with run.recorder(tmp_path / "run", reports=reports) as recorder:
        for line, message, _ in cycles:
            recorder.put(line, message)
    assert f"{lag} has changed since the daemon read it: it is not kept" in "\n".join(reports)
    assert f"{backlash} cannot be read: No such file or directory" in "\n".join(reports)
    with pytest.raises(RecordingError, match="give it with `--model`"):
        list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))
    model_files = [tmp_path / "saved.yaml", file_with(tmp_path / "backlash.yaml", "backlash")]
    model_files[0].write_bytes(adopted)
    replayed = list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run"), model_files))
    assert len(replayed) == len(cycles)
    assert not [cycle for cycle in replayed if cycle.differs]


def altered(path, number, change):
    """The file with `change` applied to the message in line `number`, counted from 0."""
    lines = path.read_bytes().splitlines(keepends=True)
    message = json.loads(lines[number])
    change(message)
    lines[number] = json.dumps(message, separators=(",", ":")).encode() + b"\n"
    path.write_bytes(b"".join(lines))


def change_reading(message):
    message["readings"]["scale_1.position"]["value"] += 1e-6


def change_carried(message):
    state = from_plain(message["carried"])
    message["carried"] = to_plain(state._replace(correction_mm=state.correction_mm + 1.0))


def change_setpoint(message):
    message["setpoint"]["tip_M_mm"][2] += 1e-7


def change_time(message):
    message["time_s"] += 1e-5


@pytest.mark.parametrize("change", [change_reading, change_carried, change_setpoint, change_time])
def test_one_changed_number_is_found_and_its_place_is_told(tmp_path, capsys, change):
    run = Run(machine())
    configuration = replace(run.machine.configuration, path=CONFIG / "tripod-cmm.yaml")
    with run.recorder(tmp_path / "run") as recorder:
        for line, message, _ in run.quiet(30):
            recorder.put(line, message)
    path = tmp_path / "run-0001.cycles.jsonl"
    altered(path, 21, change)  # two lines of opening, so the 20th cycle
    different = [cycle for cycle in replay_cycles(configuration, RecordedCycles(path)) if cycle.differs]
    assert [(cycle.tick, cycle.where) for cycle in different] == [(20, f"{path}:22")]


def shipped_run(tmp_path, cycles=30):
    """A recording of the shipped tripod, so that the command can load its configuration."""
    from compd.configuration import load
    from tests.support.live_machine import Machine

    run = Run(Machine(load(CONFIG / "tripod-cmm.yaml")))
    with run.recorder(tmp_path / "run") as recorder:
        for line, message, _ in run.quiet(cycles):
            recorder.put(line, message)
    return run


def test_the_command_says_that_nothing_differs_and_prints_setpoints(tmp_path, capsys):
    shipped_run(tmp_path)
    replay_command(tmp_path / "run", CONFIG / "tripod-cmm.yaml", setpoints=True)
    out, err = capsys.readouterr()
    assert err == "30 cycles replayed; every setpoint is the one that was sent, the same to the last bit\n"
    assert [json.loads(line)["class"] for line in out.splitlines()] == ["SETPOINT"] * 30


def test_the_command_fails_and_shows_the_first_difference(tmp_path, capsys):
    import typer

    shipped_run(tmp_path)
    path = tmp_path / "run-0001.cycles.jsonl"
    altered(path, 11, change_setpoint)
    altered(path, 15, change_setpoint)
    with pytest.raises(typer.Exit) as ended:
        replay_command(tmp_path / "run-0001.csv", CONFIG / "tripod-cmm.yaml", setpoints=False)
    assert ended.value.exit_code == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert f"2 of 30 setpoints differ; the first is tick 10, {path}:12" in err
    assert err.count('"class":"SETPOINT"') == 2


def test_another_configuration_is_told_and_may_give_other_setpoints(tmp_path, capsys):
    shipped_run(tmp_path)
    text = (CONFIG / "tripod-cmm.yaml").read_text()
    assert "valid_for_s: 0.1" in text
    other = tmp_path / "other.yaml"
    other.write_text(text.replace("valid_for_s: 0.1", "valid_for_s: 0.2"))
    import typer

    with pytest.raises(typer.Exit):
        replay_command(tmp_path / "run", other, setpoints=False)
    err = capsys.readouterr().err
    assert "recorded with another configuration" in err
    assert "30 of 30 setpoints differ" in err


def test_another_configuration_that_makes_no_difference_is_no_warning(tmp_path, capsys):
    shipped_run(tmp_path)
    other = tmp_path / "other.yaml"
    text = (CONFIG / "tripod-cmm.yaml").read_text()
    other.write_text(text.replace("port: 7750", "port: 7751"))
    replay_command(tmp_path / "run", other, setpoints=False)
    err = capsys.readouterr().err
    assert "warning" not in err
    assert (
        "every setpoint is the one that was sent, the same to the last bit, though recorded with another configuration"
        in err
    )


def test_rows_without_a_cycle_are_told_and_not_everything_is_said_to_be_there(tmp_path, capsys):
    import typer

    shipped_run(tmp_path)
    path = tmp_path / "run-0001.cycles.jsonl"
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:-10]))
    with pytest.raises(typer.Exit) as ended:
        replay_command(tmp_path / "run", CONFIG / "tripod-cmm.yaml", setpoints=False)
    assert ended.value.exit_code == 1
    err = capsys.readouterr().err
    assert f"{tmp_path / 'run-0001.csv'}: 10 rows have no cycle beside them, and cannot be replayed" in err
    assert "20 cycles replayed" in err


def test_a_line_torn_by_a_kill_is_left_out_and_counted(tmp_path, capsys):
    shipped_run(tmp_path)
    path = tmp_path / "run-0001.cycles.jsonl"
    path.write_bytes(path.read_bytes()[:-100])
    table = tmp_path / "run-0001.csv"  # written after the cycles
    table.write_bytes(b"".join(table.read_bytes().splitlines(keepends=True)[:-1]))
    replay_command(tmp_path / "run", CONFIG / "tripod-cmm.yaml", setpoints=False)
    err = capsys.readouterr().err
    assert "1 torn line" in err
    assert "29 cycles replayed" in err


@pytest.mark.parametrize(
    "damage", [b"{\n", b"[1]\n", b'{"class":"READINGS"}\n', b'{"class":"READINGS","readings":{}}\n']
)
def test_a_damaged_line_is_named(tmp_path, damage):
    run = shipped_run(tmp_path)
    path = tmp_path / "run-0001.cycles.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    lines[7] = damage
    path.write_bytes(b"".join(lines))
    with pytest.raises(RecordingError, match=r"run-0001\.cycles\.jsonl:8"):
        list(replay_cycles(run.machine.configuration, RecordedCycles(path)))


def test_a_recording_of_another_machine_is_refused(tmp_path):
    shipped_run(tmp_path)
    hexapod = machine("hexapod.yaml")
    with pytest.raises(RecordingError, match="has no reading of"):
        list(replay_cycles(hexapod.configuration, RecordedCycles(tmp_path / "run")))


def test_what_is_not_there_is_told_with_what_would_be_right(tmp_path):
    with pytest.raises(RecordingError, match="a recording by `compd recording start`"):
        RecordedCycles(tmp_path / "nothing")


def with_orders(lines):
    """Each line and message as a feed gives it, with an order before every seventh."""
    for number, (line, message, _) in enumerate(lines):
        if number % 7 == 6:
            order = {"class": "ORDER", "time_s": message["time_s"], "order": "MODEL", "subject": "apply none"}
            order |= {"client": "unix, user 1000", "by": "anna (operate)", "done": number % 2 == 0}
            yield json.dumps(order, separators=(",", ":")).encode() + b"\n", order
        yield line, message


def test_orders_are_kept_as_they_came_and_change_no_replay(tmp_path):
    run = Run(machine())
    with run.recorder(tmp_path / "run") as recorder:
        items = list(with_orders(run.quiet(40)))
        first_messages = (run.version, run.watch)
        recorder.follow((first_messages, line, message) for line, message in items)
    assert recorder.missing == 0
    assert recorder.summary() == "40 rows in 1 part"
    kept = (tmp_path / "run-0001.cycles.jsonl").read_bytes().splitlines(keepends=True)[2:]
    assert kept == [line for line, _ in items]
    recording = RecordedCycles(tmp_path / "run")
    assert not any(cycle.differs for cycle in replay_cycles(run.machine.configuration, recording))
    assert [order["by"] for order in recording.orders] == ["anna (operate)"] * 5
    assert recording.rows_without_cycle() == {}
    path = tmp_path / "run-0001.cycles.jsonl"
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:-1]))
    assert list(RecordedCycles(tmp_path / "run").rows_without_cycle().values()) == [1], "orders are no cycles"


def test_a_path_that_some_client_has_told_is_neither_waited_for_nor_copied(tmp_path):
    """The daemon tells what a client called its model file: the recorder may read more than that client."""
    run, cycles, files = with_models(tmp_path)
    secret = b"the recording person's own"
    for file, replaced in zip(files, (os.mkfifo, lambda path: path.write_bytes(secret)), strict=True):
        file.unlink()
        replaced(file)
    reports = []
    with run.recorder(tmp_path / "run", reports=reports) as recorder:
        for line, message, _ in cycles:
            recorder.put(line, message)
    assert f"{files[0]} cannot be read: it is not a regular file" in "\n".join(reports)
    assert f"{files[1]} has changed since the daemon read it" in "\n".join(reports)
    assert not list(tmp_path.glob("run*.model-*"))


def by_another_kernel(message):
    message["computed_by"]["llvm"] = "1.2.3"


@pytest.mark.parametrize(
    ("off_mm", "another", "agrees"),
    [
        (5e-13, True, Agreement.ANOTHER_KERNEL),
        (5e-13, False, Agreement.DIFFERENT),
        (5e-12, True, Agreement.DIFFERENT),
        (-5e-13, False, Agreement.SAME),
    ],
)
def test_another_kernel_may_differ_by_what_rounding_makes_of_1e_12_mm(
    tmp_path, capsys, monkeypatch, off_mm, another, agrees
):
    """Every tip lies `off_mm` beyond the place at which it is rounded to another digit than the one that was sent."""

    def beside(state, inputs, settings):
        setpoint, after = step(state, inputs, settings)
        if setpoint.seq % 2 == 0:
            tip_mm = setpoint.values.tip_M_mm.round(7) + 0.5e-7 + off_mm
            setpoint = setpoint._replace(values=setpoint.values._replace(tip_M_mm=tip_mm))
        return setpoint, after

    shipped_run(tmp_path)
    if another:
        altered(tmp_path / "run-0001.cycles.jsonl", 0, by_another_kernel)
    monkeypatch.setattr("compd.live.record.replay.step", beside)
    if agrees is Agreement.DIFFERENT:
        with pytest.raises(typer.Exit):
            replay_command(tmp_path / "run", CONFIG / "tripod-cmm.yaml")
    else:
        replay_command(tmp_path / "run", CONFIG / "tripod-cmm.yaml")
    said = capsys.readouterr().err
    assert ("15 of 30 setpoints differ" in said) == (agrees is Agreement.DIFFERENT)
    assert (f"sent, {agrees}" in said) == (agrees is not Agreement.DIFFERENT)
    assert ("15 of them" in said) == (agrees is Agreement.ANOTHER_KERNEL)
    assert ("llvm 1.2.3" in said) == another
    assert (f"replayed by {versions_text_here()}" in said) == another


@pytest.mark.parametrize("change", [change_reading, change_setpoint, change_time])
def test_another_kernel_excuses_no_other_number(tmp_path, change):
    run = shipped_run(tmp_path)
    path = tmp_path / "run-0001.cycles.jsonl"
    altered(path, 0, lambda message: message.pop("computed_by"))
    altered(path, 21, change)
    different = [cycle for cycle in replay_cycles(run.machine.configuration, RecordedCycles(path)) if cycle.differs]
    assert [(cycle.tick, cycle.where) for cycle in different] == [(20, f"{path}:22")]
