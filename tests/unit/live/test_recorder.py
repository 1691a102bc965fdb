"""A recording on disk is raw, whole and readable, whatever ends it."""

from __future__ import annotations

import json
import threading
from dataclasses import replace

import pytest
import yaml

from compd.errors import RecordingError, StateError
from compd.gauge import Quality
from compd.live.record.recorder import Recorder, RecordingLimits
from compd.live.record.replay import RecordedCycles, replay_cycles
from compd.live.system import THIS_COMPUTER, System
from compd.recording import read_recording
from tests.support.live_machine import Machine, machine
from tests.support.recorded_run import ROOMY, Run, rows_of
from tests.support.small_disk import room_for

TIMEOUT_S = 60
A_PICOMETRE_MM = 1e-9


def recorded(run, name, cycles=20, limits=ROOMY, reports=None, **watch):
    """A quiet run on disk; its READINGS."""
    messages = []
    with run.recorder(name, limits, reports, **watch) as recorder:
        for line, message, _ in run.quiet(cycles):
            recorder.put(line, message)
            messages.append(message)
    return messages


# --- What is in a recording ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_it_is_a_recording_of_the_format(tmp_path, name):
    run = Run(machine(name))
    messages = recorded(run, tmp_path / "run")
    recording = read_recording(tmp_path / "run-0001.csv", run.machine.configuration, needs_reference=False)
    assert recording.machine == run.machine.configuration.machine
    assert recording.rows == len(messages)
    assert not recording.warnings
    start_s = messages[0]["time_s"]
    assert recording.time_s.tolist() == pytest.approx([m["time_s"] - start_s for m in messages], abs=1e-6)
    assert recording.scale_mm.shape == (20, run.machine.model.links)
    assert recording.joint_mm.shape == (20, run.machine.wires.joints)
    assert recording.frame_mm.shape == (20, 9)
    assert set(recording.quantities) == {q.name for q in run.machine.configuration.wiring.quantities}


def test_it_names_its_machine_where_the_daemon_runs_with_that_file(tmp_path):
    """A file that has changed since the daemon started is another machine's."""
    run, reports = Run(machine()), []
    known = run.machine.configuration
    for name, config_hash in (("own", known.config_hash), ("changed", "0" * 64)):
        version = run.version | {"config_hash": config_hash}
        recorder = Recorder(
            tmp_path / name, version, run.watch, ROOMY, reports.append, THIS_COMPUTER, configuration=known
        )
        recorder.start()
        for line, message, _ in run.quiet(3):
            recorder.put(line, message)
        recorder.close()
    own, other = (yaml.safe_load((tmp_path / f"{name}-0001.yaml").read_text()) for name in ("own", "changed"))
    assert own["machine_file"] == str(known.path.resolve())
    assert "machine_file" not in other
    assert any("runs with another configuration" in text for text in reports)


def test_zero_plus_column_is_the_raw_reading_whatever_the_sign(tmp_path):
    plain = machine().configuration
    first, *others = plain.wiring.joint
    wiring = plain.wiring.model_copy(update={"joint": (first.model_copy(update={"sign": -1}), *others)})
    messages = recorded(Run(Machine(replace(plain, wiring=wiring))), tmp_path / "run")
    sidecar = yaml.safe_load((tmp_path / "run-0001.yaml").read_text())
    zeros = sidecar["provenance"]["zero"]
    assert len(zeros) == 21
    assert zeros["joint_1_um"] == {"channel": "joints.1", "sign": -1, "zero_mm": 12.5}
    for row, message in zip(rows_of(tmp_path / "run-0001.csv"), messages, strict=True):
        for column, zero in zeros.items():
            change_mm = float(row[column]) / (1000 if column.endswith("_um") else 1)
            raw_mm = zero["zero_mm"] + zero["sign"] * change_mm
            assert raw_mm == pytest.approx(message["readings"][zero["channel"]]["value"], abs=A_PICOMETRE_MM)
        assert row["temperature_room_degC"] == "20.0", "a quantity is recorded as it is read"
    assert sidecar["quantities_at_zero"]["temperature_link_1_degC"] == 20.0, "and effects count from these"


def test_it_is_the_raw_reading_not_the_corrected_one(tmp_path):
    run = Run(machine())
    run.machine.change_mm |= dict.fromkeys(run.machine.change_mm, 0.0)
    run.machine.change_mm["joints.4"] = 0.05
    run.machine.settle()
    setpoint = run.machine.step()
    assert setpoint.values.correction_mm[1] == pytest.approx(0.05, abs=1e-6)
    with run.recorder(tmp_path / "run") as recorder:
        recorder.put(*run.recorded(setpoint)[:2])
    (row,) = rows_of(tmp_path / "run-0001.csv")
    assert float(row["scale_2_mm"]) == 0.0
    assert float(row["joint_4_um"]) == pytest.approx(50.0)


def test_a_reading_that_is_bad_or_too_old_is_an_empty_cell(tmp_path):
    run = Run(machine())
    run.machine.step()
    run.machine.faults |= {"scale_1.position": Quality.TIMEOUT, "cabinet.room": Quality.SENSOR_FAULT}
    run.machine.frozen.add("joints.5")
    with run.recorder(tmp_path / "run") as recorder:
        for line, message, _ in run.quiet(150):
            recorder.put(line, message)
    rows = rows_of(tmp_path / "run-0001.csv")
    assert {row["scale_1_mm"] for row in rows} == {""}
    assert {row["temperature_room_degC"] for row in rows} == {""}
    assert all(row["scale_2_mm"] for row in rows)
    filled = [bool(row["joint_5_um"]) for row in rows]
    assert filled[:90] == [True] * 90, "stale after 0.5 s at 200 Hz"
    assert not any(filled[110:])


def test_the_transcript_is_what_the_daemon_said_byte_for_byte(tmp_path):
    run = Run(machine())
    sent = []
    with run.recorder(tmp_path / "run") as recorder:
        for line, message, _ in run.eventful(200):
            sent.append(line)
            recorder.put(line, message)
    kept = b""
    for path in sorted(tmp_path.glob("*.jsonl")):
        opening, watch, *lines = path.read_bytes().splitlines(keepends=True)
        assert json.loads(opening)["class"] == "VERSION"
        assert json.loads(watch)["columns"][0]["column"] == "scale_1_mm"
        kept += b"".join(lines)
    assert kept == b"".join(sent)


# --- Parts and limits ----------------------------------------------------------------------------------------


def test_a_machine_zero_taken_anew_begins_a_part_and_time_goes_on(tmp_path):
    run = Run(machine())
    reports = []
    with run.recorder(tmp_path / "run", reports=reports) as recorder:
        for _ in range(2):
            for line, message, _ in run.quiet(10):
                recorder.put(line, message)
            run.machine.change_mm["joints.1"] = 0.01
            run.take_zero()
    first, second = (rows_of(tmp_path / f"run-000{i}.csv") for i in (1, 2))
    assert (len(first), len(second)) == (10, 10)
    assert float(second[0]["time_s"]) == pytest.approx(float(first[-1]["time_s"]) + 0.005)
    assert abs(float(second[0]["joint_1_um"])) < 1
    zeros = yaml.safe_load((tmp_path / "run-0002.yaml").read_text())["provenance"]["zero"]
    assert zeros["joint_1_um"]["zero_mm"] == pytest.approx(12.51)
    assert "machine zero was taken anew" in reports
    assert len(list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))) == 20


@pytest.mark.parametrize("limits", [replace(ROOMY, part_bytes=30_000), replace(ROOMY, part_s=0.025)])
def test_parts_by_size_and_by_time_lose_no_row(tmp_path, limits):
    run = Run(machine())
    messages = recorded(run, tmp_path / "run", 40, limits)
    parts = sorted(tmp_path.glob("run-*.csv"))
    assert len(parts) > 5
    configuration = run.machine.configuration
    times = [t for part in parts for t in read_recording(part, configuration, needs_reference=False).time_s]
    assert times == pytest.approx([m["time_s"] - messages[0]["time_s"] for m in messages], abs=1e-6)


def test_at_the_limit_it_ends_and_says_so_and_what_was_written_is_whole(tmp_path):
    run = Run(machine())
    limits = RecordingLimits(part_bytes=30_000, part_s=1e9, limit_bytes=100_000, drop_oldest=False)
    with pytest.raises(RecordingError, match="reached its limit on disk") as ended:
        recorded(run, tmp_path / "run", 100, limits)
    assert "0.1 MB" in str(ended.value)
    sizes = [path.stat().st_size for path in tmp_path.iterdir()]
    assert 90_000 < sum(sizes) < 110_000
    assert rows_of(tmp_path / "run-0001.csv")[0]["time_s"] == "0", "nothing was deleted"
    rows = sum(len(rows_of(path)) for path in tmp_path.glob("*.csv"))
    assert len(list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))) == rows


def test_dropping_the_oldest_keeps_the_limit_and_says_what_went(tmp_path):
    reports = []
    limits = RecordingLimits(part_bytes=30_000, part_s=1e9, limit_bytes=100_000, drop_oldest=True)
    messages = recorded(Run(machine()), tmp_path / "run", 100, limits, reports)
    paths = sorted(tmp_path.iterdir())
    assert sum(path.stat().st_size for path in paths) <= 100_000
    gone = [text for text in reports if "deleted" in text]
    assert gone[0].startswith(f"limit of 0.1 MB: {tmp_path / 'run-0001.csv'} deleted, with ")
    kept = sum(len(rows_of(path)) for path in tmp_path.glob("*.csv"))
    deleted = sum(int(text.split()[-2]) for text in gone)
    assert kept + deleted == len(messages), "every row is either there or was told to be gone"
    assert len(paths) % 3 == 0, "a part goes with all its files"


def test_parts_too_large_for_dropping_the_oldest_are_refused():
    with pytest.raises(RecordingError, match="half of the limit"):
        RecordingLimits(part_bytes=60, part_s=1, limit_bytes=100, drop_oldest=True)


def test_nothing_is_overwritten(tmp_path):
    recorded(Run(machine()), tmp_path / "run", 3)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(RecordingError, match="is there already"):
        recorded(Run(machine()), tmp_path / "run", 3)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_without_machine_zero_nothing_is_recorded_and_it_says_what_to_do(tmp_path):
    run = Run(machine())
    run.machine.commands.zero = StateError.of("here", "machine zero has never been taken")
    with pytest.raises(StateError, match="compd zero"):
        recorded(run, tmp_path / "run", 3)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".csv", ".cycles.jsonl"])
def test_a_disk_that_is_full_ends_it_with_whole_lines_and_a_cycle_for_every_row(tmp_path, suffix):
    run = Run(machine())
    recorder = Recorder(tmp_path / "run", run.version, run.watch, ROOMY, lambda _: None, THIS_COMPUTER)
    for line, message, _ in run.quiet(10):
        recorder.put(line, message)
    recorder.write()
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    for line, message, _ in run.quiet(10):
        recorder.put(line, message)
    with room_for(len(before[tmp_path / f"run-0001{suffix}"]) + 700):
        recorder.start()
        with pytest.raises(RecordingError, match="cannot be written to: File too large"):
            recorder.close()
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert recorder.summary() == "10 rows in 1 part, 10 rows came and are not on the disk"
    assert RecordedCycles(tmp_path / "run").rows_without_cycle() == {}


def test_a_part_that_the_disk_has_no_room_to_begin_leaves_no_file(tmp_path):
    run = Run(machine())
    recorder = Recorder(tmp_path / "run", run.version, run.watch, ROOMY, lambda _: None, THIS_COMPUTER)
    recorder.put(*run.recorded(run.machine.step())[:2])
    with room_for(100):
        recorder.start()
        with pytest.raises(RecordingError, match="File too large"):
            recorder.close()
    assert list(tmp_path.iterdir()) == []
    assert recorder.summary() == "0 rows in 0 parts, 1 rows came and are not on the disk"


def test_a_directory_that_is_not_there_is_told(tmp_path):
    with pytest.raises(RecordingError, match="No such file or directory"):
        recorded(Run(machine()), tmp_path / "nowhere" / "run", 3)


class Wakes(System):
    """A clock by which the writer wakes when the test says."""

    def __init__(self):
        self.timeouts_s = []
        self.waits = threading.Semaphore(0)
        self.go = threading.Semaphore(0)

    def monotonic(self):
        return 1000.0

    def wait(self, event, timeout_s):
        self.timeouts_s.append(timeout_s)
        self.waits.release()
        assert self.go.acquire(timeout=TIMEOUT_S)
        return event.is_set()


def test_what_came_is_on_disk_at_every_wake_and_it_wakes_more_than_once_a_second(tmp_path):
    run, clock = Run(machine()), Wakes()
    recorder = Recorder(tmp_path / "run", run.version, run.watch, ROOMY, lambda _: None, clock)
    recorder.start()
    assert clock.waits.acquire(timeout=TIMEOUT_S)
    for rows in (5, 10, 15):
        for line, message, _ in run.quiet(5):
            recorder.put(line, message)
        clock.go.release()
        assert clock.waits.acquire(timeout=TIMEOUT_S), "written, and waiting again"
        assert len(rows_of(tmp_path / "run-0001.csv")) == rows
        assert len((tmp_path / "run-0001.cycles.jsonl").read_bytes().splitlines()) == 2 + rows
    clock.go.release()
    recorder.close()
    assert max(clock.timeouts_s) < 1.0


def test_a_writer_that_stalls_drops_rows_and_counts_them(tmp_path):
    run = Run(machine())
    recorder = Recorder(tmp_path / "run", run.version, run.watch, ROOMY, lambda _: None, THIS_COMPUTER)
    line, message, _ = run.recorded(run.machine.step())
    for _ in range(20_003):
        recorder.put(line, message)
    assert recorder.dropped == 3
    assert "3 rows dropped: the disk stalled" in recorder.summary()
