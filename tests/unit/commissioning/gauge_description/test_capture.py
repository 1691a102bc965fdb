"""Replies for `compd gauge learn`: out of a file, and of devices that answer or send unsolicited readings."""

from __future__ import annotations

import os
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from compd.errors import CompdError
from compd.gauge_description import capture as capture_module
from compd.gauge_description import capture_live, read_capture, saved_capture
from compd.gauge_description.capture import CapturedReply
from compd.lines.kinds.serial.settings import SerialLine
from compd.lines.stream import StreamLine
from tests.support.wire_rig import InstantClock
from tests.unit.drivers.test_unasked import TalkingPort


@contextmanager
def talker(period_s: float, end: bytes = b"\r\n") -> Iterator[str]:
    """The port of a device that says +0001.001, +0002.002 ... every `period_s`, each in two pieces."""
    master, slave = os.openpty()
    tty.setraw(slave)
    ended = threading.Event()

    def talk() -> None:
        count = 0
        while not ended.wait(period_s):
            count += 1
            os.write(master, b"+000")
            os.write(master, b"%d.%03d" % (count % 10, count % 1000) + end)

    thread = threading.Thread(target=talk)
    thread.start()
    yield os.ttyname(slave)
    ended.set()
    thread.join()
    os.close(master)
    os.close(slave)


class Talker(TalkingPort):
    """A device that says +0001.001, +0002.002 ... in virtual time, byte by byte."""

    def __init__(self, clock: InstantClock, period_s: float, end: bytes) -> None:
        super().__init__(clock, period_s)
        self._line_end = end

    def line(self, number: int) -> bytes:
        return b"+000%d.%03d" % (number % 10, number % 1000) + self._line_end


@pytest.fixture
def capture(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[CapturedReply]]:
    """Capture the lines of a device that says one every `period_s`."""

    def captured(period_s: float, timeout_s: float, wanted: int = 4, end: bytes = b"\r\n") -> list[CapturedReply]:
        clock = InstantClock()
        line = StreamLine(Talker(clock, period_s, end), timeout_s, 0.002, clock)
        monkeypatch.setattr(capture_module, "open_tapped_stream", lambda *_: line)
        settings = SerialLine(kind="serial", port="/dev/x", baud=9600, format="8N1", timeout_s=timeout_s)
        return capture_live(settings, "", wanted, lambda done, all_of_them: None, lambda text: None)

    return captured


@pytest.mark.parametrize("end", [b"\r\n", b"\r", b"\n", b"\x03"])
@pytest.mark.parametrize("timeout_s", [0.03, 1.0])
def test_a_device_that_sends_unsolicited_is_captured_line_by_line(
    capture: Callable[..., list[CapturedReply]], end: bytes, timeout_s: float
) -> None:
    """50 Hz: there is no silence, whatever the timeout."""
    captured = capture(0.02, timeout_s, end=end)
    assert all(request == b"" and len(reply) == 9 + len(end) and reply.endswith(end) for request, reply in captured)
    assert len({reply for _, reply in captured}) == 4


def test_one_whose_period_is_longer_than_the_timeout_of_a_silence(
    capture: Callable[..., list[CapturedReply]],
) -> None:
    assert all(len(reply) == 11 for _, reply in capture(0.2, 0.15, wanted=3))


def test_a_period_that_is_too_long_is_named(capture: Callable[..., list[CapturedReply]]) -> None:
    with pytest.raises(CompdError, match="--timeout longer than the period") as caught:
        capture(60.0, 0.02)
    assert "--out" in str(caught.value)


def test_a_capture_that_is_kept_is_read_again() -> None:
    captured = [
        CapturedReply(b"M1\r", b"+1.230\r"),
        CapturedReply(b"M2\r", b"\x02\xff\r"),
        CapturedReply(b"M1\r", b"+2\r"),
    ]
    kept = saved_capture(captured)
    try:
        assert read_capture(kept) == captured
    finally:
        kept.unlink()


def test_a_capture_that_cannot_be_read_is_named_by_its_line(tmp_path: Path) -> None:
    file = tmp_path / "capture.txt"
    file.write_text("> 3F\n< 2G\n")
    with pytest.raises(CompdError, match=r"capture.txt:2"):
        read_capture(file)
