"""`compd recording start` beside a running daemon: killed, stopped, left alone by it; and what the daemon tells it."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
from contextlib import ExitStack, contextmanager
from dataclasses import replace

import pytest

from compd.client import connect
from compd.configuration import load
from compd.errors import DaemonError
from compd.gauge import good
from compd.live import daemon as daemon_module
from compd.live.record import RecordedCycles, replay_cycles
from compd.operation_settings import SocketSettings, StateSettings
from compd.recording import OpenPart, convert_recording, read_recording
from tests.support.live_machine import CONFIG
from tests.support.patience import PATIENCE_S
from tests.support.running_daemon import supervised
from tests.support.sampled import sampled

NEVER_STALE_S = 1e6


class DriftingGauges:
    """In the place of the lines: every gauge is good and wanders, new at every look of a thread."""

    def __init__(self, lines, stale_after_s, latest, clock, trust, poll_requests):
        self.lines = {}
        self.latest, self.clock = latest, clock
        self.stopping = threading.Event()
        self.thread = threading.Thread(target=self.run)

    def start(self):
        self.put(0)
        self.thread.start()

    def put(self, step):
        for slot in range(len(self.latest.channels)):
            self.latest.put(slot, good(1.0 + 1e-6 * (step * (slot + 3) % 1000), self.clock.monotonic()))

    def run(self):
        step = 0
        while not self.clock.wait(self.stopping, 0.004):
            step += 1
            self.put(step)

    def stop(self, timeout_s=5.0):
        self.stopping.set()
        self.thread.join()
        return True

    def status(self):
        return {}


@contextmanager
def daemon_at(directory):
    """A running daemon with machine zero taken; its configuration and a client."""
    loaded = load(CONFIG / "tripod-cmm.yaml")
    sockets = SocketSettings(tcp={"port": 0}, unix={"path": str(directory / "s")}, valid_for_s=0.1)
    loop = loaded.loop.model_copy(update={"stale_after_s": NEVER_STALE_S, "lock_memory": False, "rate_hz": 100})
    configuration = replace(loaded, loop=loop, sockets=sockets, state=StateSettings(directory=str(directory / "state")))
    with supervised(configuration) as daemon:
        with connect(directory / "s", PATIENCE_S) as watching:
            next(setpoint for setpoint in watching.watch() if setpoint["state"] == "no_zero")
            watching.zero()
        # another one: who watches and does not read while a command starts is dropped
        with connect(directory / "s", PATIENCE_S) as client:
            yield configuration, daemon, client


@pytest.fixture
def drifting(monkeypatch):
    monkeypatch.setattr(daemon_module, "Acquisition", DriftingGauges)


@contextmanager
def record_command(directory, *arguments):
    """`compd recording start` as a process, once it has begun to write.

    It heeds SIGINT also where this process does not, as one that a script started with `&`.
    """
    command = [
        sys.executable,
        "-m",
        "compd",
        "recording",
        "start",
        str(directory / "run"),
        "--daemon",
        str(directory / "s"),
    ]
    heeded = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        process = subprocess.Popen([*command, *arguments], stderr=subprocess.PIPE, text=True)
    finally:
        signal.signal(signal.SIGINT, heeded)
    with process:
        try:
            assert re.search(r"run-0001\.(csv|parquet) begins", process.stderr.readline())
            yield process
        finally:
            process.kill()


def rows_in(path):
    return OpenPart(path).row_count if path.suffix == ".arrow" else path.read_bytes().count(b"\n") - 1


def until_rows(client, path, count):
    """Let the daemon run until `count` rows are on disk."""
    for _, _ in zip(range(20_000), client.watch(), strict=False):
        if rows_in(path) >= count:
            return
    raise AssertionError(f"{path} never had {count} rows")


@pytest.mark.usefixtures("drifting")
def test_killed_in_the_middle_it_reads_back_cleanly_and_replays(tmp_path):
    with daemon_at(tmp_path) as (configuration, _, client):
        path = tmp_path / "run-0001.csv"
        with record_command(tmp_path, "--burst", "1000") as process:
            until_rows(client, path, 60)
            on_disk = path.read_bytes()
            process.send_signal(signal.SIGKILL)
            process.wait(PATIENCE_S)
    assert path.read_bytes().startswith(on_disk), "what was on disk stays there"
    found = read_recording(path, configuration, needs_reference=False)
    assert found.rows >= 60
    replayed = list(replay_cycles(configuration, RecordedCycles(tmp_path / "run")))
    assert len(replayed) >= 60
    assert not [cycle for cycle in replayed if cycle.differs], "and gives the setpoints that the daemon sent"
    assert len({cycle.replayed for cycle in replayed}) == len(replayed)


@pytest.mark.long
@pytest.mark.sample
@pytest.mark.usefixtures("drifting")
def test_killed_while_it_writes_parquet_every_synchronised_row_is_there_and_replays(tmp_path):
    with daemon_at(tmp_path) as (configuration, _, client):
        left = tmp_path / "run-0001.arrow"
        with record_command(tmp_path, "--burst", "1000", "--format", "parquet") as process:
            until_rows(client, left, 60)
            on_disk = left.read_bytes()
            process.send_signal(signal.SIGKILL)
            process.wait(PATIENCE_S)
    assert left.read_bytes().startswith(on_disk), "what was on disk stays there"
    rows = convert_recording(left, left.with_suffix(".parquet"))
    assert rows >= 60
    assert read_recording(left.with_suffix(".parquet"), configuration, needs_reference=False).rows == rows
    recorded = RecordedCycles(tmp_path / "run")
    assert recorded.rows_without_cycle() == {}
    replayed = list(replay_cycles(configuration, recorded))
    assert len(replayed) >= rows
    assert not [cycle for cycle in replayed if cycle.differs]


@pytest.mark.usefixtures("drifting")
@pytest.mark.parametrize("end", sampled([signal.SIGTERM, signal.SIGINT], 2))
def test_it_ends_at_a_signal_with_everything_written(tmp_path, end):
    with daemon_at(tmp_path) as (configuration, _, client):
        with record_command(tmp_path, "--rate-hz", "20") as process:
            until_rows(client, tmp_path / "run-0001.csv", 10)
            process.send_signal(end)
            _, said = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0
    rows = rows_in(tmp_path / "run-0001.csv")
    assert f"{rows} rows in 1 part" in said
    times_s = [m["time_s"] for _, m in RecordedCycles(tmp_path / "run").cycles()]
    assert len(times_s) - 1 <= (times_s[-1] - times_s[0]) * 20 + 0.2, "100 Hz thinned to 20 Hz"
    assert not [cycle for cycle in replay_cycles(configuration, RecordedCycles(tmp_path / "run")) if cycle.differs]


@pytest.mark.long
@pytest.mark.sample
@pytest.mark.usefixtures("drifting")
def test_it_goes_on_in_a_new_part_when_the_daemon_has_started_anew(tmp_path):
    with ExitStack() as stack:
        with daemon_at(tmp_path) as (configuration, _, client):
            process = stack.enter_context(record_command(tmp_path))
            until_rows(client, tmp_path / "run-0001.csv", 3)
        assert "the daemon is gone" in process.stderr.readline()
        with supervised(configuration), connect(tmp_path / "s", PATIENCE_S) as again:
            assert "the daemon is back: nothing was recorded for " in process.stderr.readline()
            assert "run-0002.csv begins" in process.stderr.readline()
            until_rows(again, tmp_path / "run-0002.csv", 3)
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0
    rows = sum(rows_in(tmp_path / f"run-000{part}.csv") for part in (1, 2))
    assert f"{rows} rows in 2 parts" in said
    replayed = list(replay_cycles(configuration, RecordedCycles(tmp_path / "run")))
    assert len(replayed) == rows
    assert not [cycle for cycle in replayed if cycle.differs]


@pytest.mark.long
@pytest.mark.usefixtures("drifting")
def test_while_the_daemon_is_away_ctrl_c_ends_it_with_everything_written(tmp_path):
    with daemon_at(tmp_path) as (_, _, client), record_command(tmp_path) as process:
        until_rows(client, tmp_path / "run-0001.csv", 3)
        os.kill(client.status()["processes"]["supervisor"]["pid"], signal.SIGTERM)
        assert "the daemon is gone" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0
    assert f"{rows_in(tmp_path / 'run-0001.csv')} rows in 1 part" in said


@pytest.mark.long
@pytest.mark.usefixtures("drifting")
def test_a_burst_has_every_cycle_for_as_long_as_asked_and_no_longer(tmp_path, capsys, monkeypatch):
    from compd.cli.measurements.recording.start import start as record

    monkeypatch.setattr(signal, "signal", lambda *_: None)  # this process keeps its own
    with daemon_at(tmp_path):
        record(
            tmp_path / "run",
            str(tmp_path / "s"),
            burst=0.5,
            rate_hz=10.0,
            seconds=None,
            part_mb=1.0,
            part_hours=1.0,
            limit_mb=10.0,
        )
    messages = [message for _, message in RecordedCycles(tmp_path / "run").cycles()]
    assert messages[-1]["time_s"] - messages[0]["time_s"] < 0.5
    seqs = [message["seq"] for message in messages]
    missing = seqs[-1] - seqs[0] + 1 - len(seqs)
    said = capsys.readouterr().err
    assert f"{len(seqs)} rows in 1 part" in said
    assert (f"{missing} cycles did not come" in said) == (missing > 0)
    watch = json.loads((tmp_path / "run-0001.cycles.jsonl").read_bytes().splitlines()[1])
    assert "rate_hz" not in watch, "every cycle was asked for"


@pytest.mark.long
@pytest.mark.usefixtures("drifting")
def test_a_recorder_that_reads_nothing_for_a_while_is_not_dropped_and_misses_nothing(tmp_path):
    with daemon_at(tmp_path) as (_, _, client), connect(tmp_path / "s", PATIENCE_S) as slow:
        lines = slow.readings()
        next(lines)
        seqs = [next(lines)[1]["seq"]]
        newest = [setpoint["seq"] for _, setpoint in zip(range(200), client.watch(), strict=False)][-1]
        while seqs[-1] < newest:
            seqs.append(next(lines)[1]["seq"])
        assert newest - seqs[0] + 1 - len(seqs) <= client.status()["loop"]["missed_cycles"]
        assert client.status()["publisher"]["dropped_clients"] == 0


@pytest.mark.usefixtures("drifting")
def test_readings_are_for_the_unix_socket_and_say_what_went_into_the_setpoint(tmp_path):
    with daemon_at(tmp_path) as (_, daemon, client):
        with (
            connect(f"127.0.0.1:{daemon.listeners.tcp_port}", PATIENCE_S) as remote,
            pytest.raises(DaemonError, match="Unix socket only"),
        ):
            next(remote.readings())
        with connect(tmp_path / "s", PATIENCE_S) as local:
            lines = local.readings(50)
            _, answer = next(lines)
            assert answer["rate_hz"] == 50
            assert {column["column"] for column in answer["columns"]} >= {"scale_1_mm", "frame_u6_um"}
            line, message = next(lines)
            assert line.endswith(b"}\n")
            assert message["class"] == "READINGS"
            assert message["setpoint"]["seq"] == message["seq"]
            assert set(message["readings"]) == set(daemon.latest.channels)
        setpoint = next(client.watch())
        assert setpoint["class"] == "SETPOINT"
