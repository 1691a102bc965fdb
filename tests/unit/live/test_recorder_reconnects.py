"""A recording goes on when the daemon ends and starts again."""

from __future__ import annotations

from contextlib import suppress

import pytest

from compd.errors import DaemonError
from compd.live.record.readings_feed import ReadingsFeed
from compd.live.record.recorder import Recorder
from compd.live.record.replay import RecordedCycles, replay_cycles
from compd.live.system import THIS_COMPUTER
from tests.support.live_machine import machine
from tests.support.recorded_run import ROOMY, Run, rows_of


class Turned:
    """A clock that moves by what is waited for."""

    def __init__(self):
        self.now_s = 1000.0

    def monotonic(self):
        return self.now_s

    def wait(self, event, timeout_s):
        self.now_s += timeout_s
        return event.is_set()


def gone(what="the daemon is gone: it closed the connection"):
    return DaemonError.of("socket", what)


class NobodyLeft(Exception):
    """The test is over: all connections have spoken."""


class Spoken:
    """A connection on which the daemon says these lines, and ends."""

    def __init__(self, run, lines):
        self.version = dict(run.version)
        self.watch = dict(run.watch)
        self.lines = lines
        self.closed = False

    def readings(self, rate_hz=None):
        yield b"", self.watch
        yield from self.lines
        raise gone()

    def close(self):
        self.closed = True


def connecting(answers):
    """`connect` that returns or raises these, one after the other."""
    answers = iter(answers)

    def connect():
        answer = next(answers, NobodyLeft())
        if isinstance(answer, Exception):
            raise answer
        return answer

    return connect


def fed(tmp_path, answers, for_s=None, reports=None):
    """Record what the connections say; the recorder, closed."""
    reports, clock = [] if reports is None else reports, Turned()
    feed = ReadingsFeed(connecting(answers), None, reports.append, clock)
    recorder = Recorder(tmp_path / "run", *feed.first_messages, ROOMY, reports.append, THIS_COMPUTER)
    recorder.start()
    with suppress(NobodyLeft):
        recorder.follow(feed.messages(for_s))
    recorder.close()
    return recorder


def lines_of(run, cycles):
    return [(line, message) for line, message, _ in run.quiet(cycles)]


def test_it_goes_on_in_a_new_part_when_the_daemon_is_back_and_says_how_long_it_was_away(tmp_path):
    run, reports = Run(machine()), []
    connections = [Spoken(run, lines_of(run, 10)), gone("no daemon answers"), gone("no daemon answers")]
    connections.append(Spoken(run, lines_of(run, 5)))
    recorder = fed(tmp_path, connections, reports=reports)
    assert [len(rows_of(tmp_path / f"run-000{i}.csv")) for i in (1, 2)] == [10, 5]
    assert "the daemon is gone: it closed the connection; the recording goes on when it is back" in reports
    assert "the daemon is back: nothing was recorded for 1.5 s" in reports
    assert recorder.summary() == "15 rows in 2 parts"
    assert recorder.missing == 0, "a daemon that starts anew counts from 1; its cycles are not missing"
    assert connections[0].closed
    times_s = [float(row["time_s"]) for i in (1, 2) for row in rows_of(tmp_path / f"run-000{i}.csv")]
    assert times_s == sorted(times_s), "time goes on"
    assert len(list(replay_cycles(run.machine.configuration, RecordedCycles(tmp_path / "run")))) == 15


def test_a_daemon_that_is_not_back_in_time_does_not_prolong_the_recording(tmp_path):
    run = Run(machine())
    first = Spoken(run, lines_of(run, 10))
    start_s = first.lines[0][1]["time_s"]
    recorder = fed(tmp_path, [first] + [gone()] * 10_000, for_s=1000.0 + 3.0 - start_s)
    assert recorder.summary() == "10 rows in 1 part"


def test_a_daemon_that_comes_back_without_machine_zero_is_waited_for(tmp_path):
    run, reports = Run(machine()), []
    with_zero = lines_of(run, 4)
    without = [(line, {key: message[key] for key in message if key != "zero"}) for line, message in lines_of(run, 3)]
    recorder = fed(tmp_path, [Spoken(run, with_zero), Spoken(run, without + lines_of(run, 2))], reports=reports)
    assert reports.count("the daemon has no machine zero now: nothing is recorded until `compd zero`") == 1
    assert recorder.summary() == "6 rows in 2 parts, 3 rows not written: the daemon had no machine zero"


def test_another_configuration_is_told(tmp_path):
    run, reports = Run(machine()), []
    second = Spoken(run, lines_of(run, 2))
    second.version["config_hash"] = "another"
    fed(tmp_path, [Spoken(run, lines_of(run, 2)), second], reports=reports)
    assert any("its configuration is another one now" in text for text in reports)
    assert RecordedCycles(tmp_path / "run").config_hashes() == {"another", run.version["config_hash"]}


def test_a_first_connection_that_fails_is_an_error_at_once(tmp_path):
    with pytest.raises(DaemonError, match="no daemon answers"):
        fed(tmp_path, [gone("no daemon answers")])
