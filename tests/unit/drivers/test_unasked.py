"""Described devices that send unsolicited readings: which of their lines counts, its time, and their silence."""

from __future__ import annotations

import pytest

from compd.gauge import LineFault, Quality, Reading
from compd.lines import StreamLine
from tests.support.ascii_gauge import gauge, line_with
from tests.support.wire_rig import InstantClock, ScriptedPort


def listening(*script: bytes) -> list[Reading]:
    device = gauge(**{"out": "", "out_terminator": "", "in": "%f", "channels": [{"name": "t", "unit": "degC"}]})
    line, _ = line_with(*script)
    return list(device.read(line))


def test_the_newest_whole_line_counts_and_never_a_half_one() -> None:
    # what waits is old; then the end of a line, and a whole one
    (reading,) = listening(b"+10.0\r\n+11.0\r\n+1", b"", b"2.5\r\n+13.0", b"\r\n")
    assert reading.value == 13.0
    (reading,) = listening(b"", b"+12.5\r\n", b"+13.0\r\n")
    assert reading.value == 13.0


def test_the_age_of_what_comes_unsolicited_is_never_understated() -> None:
    clock = InstantClock()
    port = ScriptedPort(clock, [b"+10.0\r\n", b"", b"+12.5\r\n", b"+13.0\r\n"])
    line = StreamLine(port, 0.1, 0.002, clock)
    began_s = clock.now_s
    device = gauge(**{"out": "", "out_terminator": "", "in": "%f", "channels": [{"name": "t", "unit": "degC"}]})
    assert device.read(line)[0].time_s == began_s
    assert port.written == []


class TalkingPort(ScriptedPort):
    """A device that sends a number every `period_s`, byte by byte; its sensor is read when a line begins."""

    character_s = 1e-3

    def __init__(self, clock: InstantClock, period_s: float) -> None:
        super().__init__(clock)
        self._talk_clock = clock
        self._period_s = period_s
        self._read_s = clock.now_s

    def line(self, number: int) -> bytes:
        return f"{number:+08.1f}\r\n".encode()

    def begins_s(self, number: int) -> float:
        return 100.0 + number * self._period_s

    def read(self, timeout_s: float) -> bytes:
        clock, until_s = self._talk_clock, self._talk_clock.now_s + max(0.0, timeout_s)
        came, due_s = b"", self._read_s
        number = max(0, int((self._read_s - 100.0) / self._period_s) - 1)
        while self.begins_s(number) <= until_s:
            for index, byte in enumerate(self.line(number), start=1):
                at_s = self.begins_s(number) + index * self.character_s
                if self._read_s < at_s <= (clock.now_s if came else until_s):
                    came, due_s = came + bytes([byte]), at_s
                    clock.now_s = max(clock.now_s, at_s)
            number += 1
        if came:
            self._read_s = due_s
        else:
            clock.now_s = until_s
        return came


UNASKED = {"out": "", "out_terminator": "", "in": "%+08.1f", "channels": [{"name": "t", "unit": "degC"}]}


@pytest.mark.parametrize("period_s", [0.011, 0.02, 0.1])
def test_a_talker_is_read_at_its_full_rate(period_s: float) -> None:
    clock = InstantClock()
    port = TalkingPort(clock, period_s)
    line = StreamLine(port, 0.3, 0.002, clock)
    device = gauge(**UNASKED)
    values = []
    for _ in range(20):
        (reading,) = device.read(line)
        values.append(int(reading.value))
        assert reading.time_s <= port.begins_s(int(reading.value)), "its age is never understated"
        assert clock.now_s - reading.time_s < 2.5 * period_s + 0.02
    assert values == list(range(values[0], values[0] + 20)), "not one line is left out"


def test_of_a_talker_that_is_seldom_asked_the_newest_line_counts() -> None:
    clock = InstantClock()
    port = TalkingPort(clock, 0.02)
    line = StreamLine(port, 0.3, 0.002, clock)
    device = gauge(**UNASKED)
    for _ in range(5):
        (reading,) = device.read(line)
        assert clock.now_s - reading.time_s < 0.06
        assert reading.time_s <= port.begins_s(int(reading.value))
        clock.now_s += 0.5


def test_a_talker_that_stops_within_a_line_has_its_own_patience() -> None:
    clock = InstantClock()
    script = [b"", b"+00001.0\r\n", b"+00002", b""]
    line = StreamLine(ScriptedPort(clock, script), 0.3, 0.002, clock)
    device = gauge(**UNASKED, gap_timeout_s=2.0)
    began_s = clock.now_s
    with pytest.raises(LineFault, match="incomplete"):
        device.read(line)
    assert clock.now_s - began_s >= 2.0


def test_a_talker_that_is_slower_than_the_timeout_is_told_so() -> None:
    clock = InstantClock()
    line = StreamLine(TalkingPort(clock, 1.0), 0.3, 0.002, clock)
    with pytest.raises(LineFault, match="`reply_timeout_s` must be longer than the period"):
        gauge(**UNASKED).read(line)
    patient = gauge(**UNASKED, reply_timeout_s=1.5)
    assert patient.read(line)[0].ok


def test_a_device_that_stops_speaking() -> None:
    with pytest.raises(LineFault) as caught:
        listening(b"", b"+12.5\r\n")
    assert caught.value.quality is Quality.TIMEOUT
    with pytest.raises(LineFault) as caught:
        listening(b"", b"+12.5\r\n", b"+13.")
    assert caught.value.quality is Quality.INCOMPLETE


def test_a_line_opened_between_the_bytes_of_a_terminator_is_read() -> None:
    clock = InstantClock()
    line = StreamLine(ScriptedPort(clock, [b"", b"\n+00001.0\r\n", b"+00002.0\r\n"]), 0.3, 0.002, clock)
    text, _ = line.next_line(b"\r\n", limit=10)
    assert text == b"+00002.0"
