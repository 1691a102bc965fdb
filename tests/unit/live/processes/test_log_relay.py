"""The log of the daemon's processes: whole lines through real pipes, a flood held back, an end survived."""

from __future__ import annotations

import fcntl
import os
import threading
from array import array
from collections.abc import Iterator
from contextlib import ExitStack
from termios import FIONREAD

import pytest
import structlog

from compd.live.processes import log_relay
from compd.live.processes.log_relay import BURST_LINES, LINES_PER_S, MAX_LINE_BYTES, READ_BYTES, LogRelay
from tests.support.patience import PATIENCE_S
from tests.support.wire_rig import InstantClock

LARGE_PIPE = 1 << 20


class Pipe:
    """A process's output, as long as this test writes it."""

    def __init__(self) -> None:
        self.end, self._write_end = os.pipe()
        fcntl.fcntl(self._write_end, fcntl.F_SETPIPE_SZ, LARGE_PIPE)

    def print(self, text: str | bytes) -> None:
        data = text.encode() if isinstance(text, str) else text
        assert os.write(self._write_end, data) == len(data)

    def close(self) -> None:
        """The process ends."""
        if self._write_end >= 0:
            os.close(self._write_end)
            self._write_end = -1

    @property
    def waiting(self) -> int:
        """Bytes that nobody has read."""
        count = array("i", [0])
        fcntl.ioctl(self.end, FIONREAD, count)
        return count[0]


class Bench:
    """A relay of two pipes on a clock of its own, whose rounds the test makes."""

    def __init__(self) -> None:
        self.clock = InstantClock()
        self.pipes = {"loop": Pipe(), "line dial": Pipe()}
        self.lines: list[str] = []
        self.relay = LogRelay({name: pipe.end for name, pipe in self.pipes.items()}, self.lines.append, self.clock)

    def relayed(self, after_s: float = 0.0) -> list[str]:
        """What one round relays, `after_s` later."""
        self.clock.now_s += after_s
        self.lines.clear()
        self.relay.round()
        return list(self.lines)


@pytest.fixture
def bench() -> Iterator[Bench]:
    with ExitStack() as stack:
        bench = Bench()
        for pipe in bench.pipes.values():
            stack.callback(os.close, pipe.end)
            stack.callback(pipe.close)
        stack.callback(bench.relay.stop)
        yield bench


@pytest.fixture
def dial(bench: Bench) -> Pipe:
    return bench.pipes["line dial"]


def dropped(logs: list[dict[str, object]]) -> list[tuple[object, object]]:
    return [(log["source"], log["count"]) for log in logs if log["event"] == "log lines dropped"]


def test_lines_come_whole_from_every_pipe(bench: Bench, dial: Pipe) -> None:
    bench.pipes["loop"].print("granted\n")
    dial.print("line is open\n\nha")
    assert sorted(bench.relayed()) == ["\n", "granted\n", "line is open\n"]
    dial.print("lf a line\nand")
    assert bench.relayed() == ["half a line\n"]
    assert bench.relayed() == []


def test_a_flood_passes_at_its_rate_and_the_rest_is_counted(bench: Bench, dial: Pipe) -> None:
    with structlog.testing.capture_logs() as logs:
        dial.print("".join(f"line {i}\n" for i in range(1000)))
        assert bench.relayed() == [f"line {i}\n" for i in range(BURST_LINES)]
        assert dropped(logs) == [("line dial", 1000 - BURST_LINES)]
        dial.print("more\n" * 1000)
        assert len(bench.relayed(after_s=0.5)) == 0.5 * LINES_PER_S
        assert len(dropped(logs)) == 1, "one report per second at most"
        assert len(bench.relayed(after_s=0.5)) == 0
        assert dropped(logs)[1:] == [("line dial", 1000 - 0.5 * LINES_PER_S)]
        bench.relayed(after_s=1.0)
        assert len(dropped(logs)) == 2, "nothing new to report"


def test_a_flood_costs_its_own_source_only(bench: Bench, dial: Pipe) -> None:
    dial.print("x\n" * 1000)
    bench.relayed()
    bench.pipes["loop"].print("granted\n")
    dial.print("x\n" * 1000)
    assert bench.relayed() == ["granted\n"]


def test_the_average_holds_over_a_long_flood(bench: Bench, dial: Pipe) -> None:
    count, rounds = 0, 200
    for _ in range(rounds):
        dial.print("x\n" * 10)
        count += len(bench.relayed(after_s=log_relay.ROUND_S))
    assert count == pytest.approx(BURST_LINES + rounds * log_relay.ROUND_S * LINES_PER_S, abs=3)


def test_a_round_reads_so_much_of_a_pipe_and_no_more(bench: Bench, dial: Pipe) -> None:
    dial.print(b"0123456789abcde\n" * (4 * READ_BYTES // 16))
    for left in (3, 2, 1, 0):
        bench.relayed()
        assert dial.waiting == left * READ_BYTES


@pytest.mark.parametrize("pieces", [1, 7, 40])
def test_a_line_that_is_too_long_is_cut_and_the_next_is_whole(bench: Bench, dial: Pipe, pieces: int) -> None:
    for _ in range(pieces):
        dial.print("y" * 5000)
        assert bench.relayed() == []
    dial.print("\nnext\n")
    assert bench.relayed() == ["y" * MAX_LINE_BYTES + " ...\n", "next\n"]
    dial.print("z" * MAX_LINE_BYTES + "\n")
    assert bench.relayed() == ["z" * MAX_LINE_BYTES + "\n"], "just short enough"


def test_bytes_that_are_no_text_are_replaced(bench: Bench, dial: Pipe) -> None:
    dial.print(b"5 \xb5m\n")
    assert bench.relayed() == ["5 \ufffdm\n"]


def test_the_end_of_a_pipe_is_seen_once_and_the_others_go_on(
    bench: Bench, dial: Pipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    dial.print("Segmentation fau")
    dial.close()
    reads: list[int] = []
    read = os.read
    monkeypatch.setattr(log_relay.os, "read", lambda fd, count: reads.append(fd) or read(fd, count))
    assert bench.relayed() == []
    assert bench.relayed() == ["Segmentation fau\n"]
    reads.clear()
    bench.pipes["loop"].print("still here\n")
    assert bench.relayed() == ["still here\n"]
    assert reads == [bench.pipes["loop"].end], "an ended pipe would be ready for ever"


def test_where_nobody_reads_the_log_the_pipes_are_emptied_all_the_same(bench: Bench, dial: Pipe) -> None:
    def broken(_: str) -> None:
        raise BrokenPipeError

    relay = LogRelay({"line dial": dial.end}, broken, bench.clock)
    dial.print("a\nb\n")
    relay.round()
    assert dial.waiting == 0
    relay.stop()


def test_the_thread_relays_what_comes_and_at_the_end_what_is_there(dial: Pipe) -> None:
    lines: list[str] = []
    came = threading.Event()

    def write(line: str) -> None:
        lines.append(line)
        came.set()

    relay = LogRelay({"line dial": dial.end}, write, InstantClock())
    relay.start()
    dial.print("first\n")
    assert came.wait(PATIENCE_S)
    dial.print("second\nunfinished")
    relay.stop()
    assert lines == ["first\n", "second\n", "unfinished\n"]


def test_the_thread_reports_the_last_dropped_lines(dial: Pipe) -> None:
    many = 3 * BURST_LINES
    with structlog.testing.capture_logs() as logs:
        relay = LogRelay({"line dial": dial.end}, lambda _: None, InstantClock())
        dial.print("x\n" * many)
        relay.start()
        relay.stop()
    count = sum(int(str(count)) for _, count in dropped(logs))
    assert many - BURST_LINES - LINES_PER_S <= count <= many - BURST_LINES


def test_stopping_does_not_wait_for_a_log_that_hangs(dial: Pipe, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_relay, "_STOP_TIMEOUT_S", 0.05)
    hangs, goes_on = threading.Event(), threading.Event()

    def write(_: str) -> None:
        hangs.set()
        goes_on.wait(PATIENCE_S)

    relay = LogRelay({"line dial": dial.end}, write, InstantClock())
    relay.start()
    dial.print("a\n")
    assert hangs.wait(PATIENCE_S)
    relay.stop()
    goes_on.set()
    relay._thread.join(PATIENCE_S)
    assert not relay._thread.is_alive()
