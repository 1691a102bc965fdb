"""A recording as Parquet: whole parts, a part that a kill has left open, a disk that is full."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from compd.errors import RecordingError
from compd.live.record.recorder import Recorder
from compd.live.record.replay import RecordedCycles, replay_cycles
from compd.live.system import THIS_COMPUTER
from compd.recording import convert_recording, read_recording
from compd.tables import TableFormat
from tests.support.live_machine import machine
from tests.support.recorded_run import ROOMY, Run
from tests.support.small_disk import room_for

# Records twenty rows, says so, and waits to be killed; the directory is its argument.
KILLED = """
import sys
from pathlib import Path
from tests.support.live_machine import machine
from tests.support.recorded_run import Run
from tests.unit.live.test_recorder_parquet import parquet_recorder

run = Run(machine())
recorder = parquet_recorder(run, Path(sys.argv[1]) / "run")
for _ in range(2):
    for line, message, _ in run.quiet(10):
        recorder.put(line, message)
    recorder.write()
print("written", flush=True)
sys.stdin.read()
"""


def parquet_recorder(run, name, limits=ROOMY, report=lambda _: None):
    return Recorder(name, run.version, run.watch, limits, report, THIS_COMPUTER, TableFormat.PARQUET)


@contextmanager
def recording(run, name, limits=ROOMY, report=lambda _: None):
    recorder = parquet_recorder(run, name, limits, report)
    recorder.start()
    yield recorder
    recorder.close()


def names_in(directory):
    return sorted(path.name for path in directory.iterdir())


def test_it_is_the_recording_that_csv_has(tmp_path):
    run = Run(machine())
    with run.recorder(tmp_path / "csv") as plain, recording(run, tmp_path / "run") as recorder:
        for line, message, _ in run.eventful(60):
            plain.put(line, message)
            recorder.put(line, message)
    parts = sorted(tmp_path.glob("run-*.parquet"))
    assert len(parts) == len(list(tmp_path.glob("csv-*.csv")))
    assert not list(tmp_path.glob("*.arrow"))
    for part in parts:
        found = read_recording(part, run.machine.configuration, needs_reference=False)
        wanted = read_recording(part.with_name(f"csv{part.stem[3:]}.csv"), needs_reference=False)
        for name, values in wanted.columns.items():
            assert np.array_equal(found.columns[name], values, equal_nan=True), name
        assert pq.ParquetFile(part).metadata.num_row_groups == 1
    assert RecordedCycles(tmp_path / "run").rows_without_cycle() == {}
    assert RecordedCycles(parts[0]).paths == [parts[0].with_suffix(".cycles.jsonl")]
    assert len(list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))) == 60


def test_parts_by_size_lose_no_row_and_the_oldest_is_dropped_with_all_its_files(tmp_path):
    run, reports = Run(machine()), []
    limits = replace(ROOMY, part_bytes=30_000, limit_bytes=100_000, drop_oldest=True)
    with recording(run, tmp_path / "run", limits, reports.append) as recorder:
        for line, message, _ in run.quiet(100):
            recorder.put(line, message)
    kept = sum(pq.read_metadata(part).num_rows for part in tmp_path.glob("*.parquet"))
    deleted = [int(text.split()[-2]) for text in reports if "deleted" in text]
    assert deleted
    assert kept + sum(deleted) == 100
    assert len(names_in(tmp_path)) % 3 == 0


@pytest.fixture
def killed(tmp_path):
    """What a recorder leaves that is killed while its part is open."""
    command = [sys.executable, "-c", KILLED, str(tmp_path)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdout.readline() == "written\n"
        reports = []
        with pytest.raises(RecordingError, match="is there already"):
            parquet_recorder(Run(machine()), tmp_path / "run", report=reports.append)
        assert reports == [], "a part that is being recorded is left alone"
        process.send_signal(signal.SIGKILL)
    return tmp_path / "run-0001.arrow"


@pytest.mark.long
def test_killed_in_the_middle_every_synchronised_row_can_be_read(killed):
    assert not killed.with_suffix(".parquet").exists()
    with killed.open("ab") as file:
        file.write(b"\xff\xff\xff\xff\x00\x01\x00\x00torn")
    assert RecordedCycles(killed).rows_without_cycle() == {}
    assert convert_recording(killed, killed.with_suffix(".parquet")) == 20
    configuration = machine().configuration
    assert read_recording(killed.with_suffix(".parquet"), configuration, needs_reference=False).rows == 20
    assert len(list(replay_cycles(configuration, RecordedCycles(killed.with_name("run"))))) == 20
    reports = []
    with pytest.raises(RecordingError, match="is there already"):
        parquet_recorder(Run(machine()), killed.with_name("run"), report=reports.append)
    assert reports == [f"{killed}, left by a recorder that was killed, is run-0001.parquet now"]
    assert names_in(killed.parent) == ["run-0001.cycles.jsonl", "run-0001.parquet", "run-0001.yaml"]
    assert pq.read_metadata(killed.with_suffix(".parquet")).num_rows == 20


def test_what_is_left_and_damaged_is_told_and_stays(tmp_path):
    (tmp_path / "run-0001.arrow").write_bytes(b"no stream")
    reports = []
    with pytest.raises(RecordingError, match="is there already"):
        parquet_recorder(Run(machine()), tmp_path / "run", report=reports.append)
    assert "is left as it is" in reports[0]
    assert names_in(tmp_path) == ["run-0001.arrow"]


@pytest.mark.parametrize("suffix", [".arrow", ".cycles.jsonl"])
def test_a_disk_that_is_full_ends_it_with_a_cycle_for_every_row(tmp_path, suffix):
    run = Run(machine())
    recorder = parquet_recorder(run, tmp_path / "run")
    for line, message, _ in run.quiet(10):
        recorder.put(line, message)
    recorder.write()
    size = (tmp_path / f"run-0001{suffix}").stat().st_size
    for line, message, _ in run.quiet(10):
        recorder.put(line, message)
    with room_for(size + 700):
        recorder.start()
        with pytest.raises(RecordingError, match="cannot be written to: File too large"):
            recorder.close()
    left = next(path for path in tmp_path.iterdir() if path.suffix in (".arrow", ".parquet"))
    if left.suffix == ".arrow":
        convert_recording(left, left.with_suffix(".parquet"))
    assert pq.read_metadata(left.with_suffix(".parquet")).num_rows == 10
    assert RecordedCycles(tmp_path / "run").rows_without_cycle() == {}
