"""A device that has become slower within its replies is waited for after one poll, by every Modbus master."""

from __future__ import annotations

import struct
from collections.abc import Callable

import pytest

from compd.gauge import LineFault, Quality
from compd.lines.kinds.modbus_ascii.master import AsciiMaster, lrc
from compd.lines.kinds.modbus_rtu.master import RtuMaster, crc16
from compd.lines.modbus_serial import SerialMaster
from compd.lines.stream import MIN_REST, StreamLine
from compd.lines.usual_time import FEWEST, MAX_IN_VAIN
from tests.support.wire_rig import InstantClock, ScriptedPort

TIMEOUT_S = 0.1
PAUSE_S = 0.6 * TIMEOUT_S
UNIT, REGISTERS = 1, (1010, 1011, 1012)
MESSAGE = bytes([UNIT, 4, 2 * len(REGISTERS)]) + struct.pack(">3H", *REGISTERS)
RTU_FRAME = MESSAGE + crc16(MESSAGE).to_bytes(2, "little")
ASCII_FRAME = b":" + (MESSAGE + bytes([lrc(MESSAGE)])).hex().upper().encode() + b"\r\n"


class PausingPort(ScriptedPort):
    """A device that answers every request with `frame`, and pauses once within it."""

    def __init__(self, clock: InstantClock, frame: bytes) -> None:
        super().__init__(clock)
        self.frame = frame
        self.pause_s, self.behind = 0.0, len(frame)  # the pause, and behind so many bytes
        self.echo = False
        self._coming: list[tuple[float, bytes]] = []

    def write(self, data: bytes) -> None:
        self.written.append(data)
        now_s = self._clock.now_s
        parts = [(now_s, self.frame[: self.behind]), (now_s + self.pause_s, self.frame[self.behind :])]
        self._coming = [(now_s, data)] * self.echo + [(at_s, part) for at_s, part in parts if part]

    def read(self, timeout_s: float) -> bytes:
        until_s = self._clock.now_s + max(0.0, timeout_s)
        if not self._coming or self._coming[0][0] > until_s:
            self._clock.now_s = until_s
            return b""
        at_s, part = self._coming.pop(0)
        self._clock.now_s = max(self._clock.now_s, at_s)
        return part


def outcome(line: SerialMaster) -> str:
    """Of one poll: "ok", or the fault's quality. Drained behind a fault as the daemon does."""
    try:
        assert line.read_registers(UNIT, 4, 10, len(REGISTERS)).registers == REGISTERS
    except LineFault as fault:
        line.drain()
        return str(fault.quality)
    return "ok"


MASTERS: dict[str, tuple[Callable[[StreamLine], SerialMaster], bytes]] = {
    "rtu": (lambda stream: RtuMaster(stream, ask_one_more=False), RTU_FRAME),
    "ascii": (lambda stream: AsciiMaster(stream, ask_one_more=False), ASCII_FRAME),
}


@pytest.mark.parametrize("echo", [False, True])
@pytest.mark.parametrize("kind", MASTERS)
@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_a_device_that_has_become_slower_costs_one_poll(kind: str, share: float, echo: bool) -> None:
    """It pauses within the head of the frame, between head and rest, or within the rest."""
    make, frame = MASTERS[kind]
    clock = InstantClock()
    port = PausingPort(clock, frame)
    port.echo = echo
    line = make(StreamLine(port, TIMEOUT_S, 0.001, clock, echo))
    assert {outcome(line) for _ in range(FEWEST)} == {"ok"}
    port.pause_s, port.behind = PAUSE_S, int(share * len(frame))
    outcomes = [outcome(line) for _ in range(10)]
    assert outcomes == [str(Quality.INCOMPLETE)] + 9 * ["ok"]


@pytest.mark.parametrize("kind", MASTERS)
@pytest.mark.parametrize("at", ["head", "rest"])
def test_a_device_slower_from_the_start_is_never_given_up(kind: str, at: str) -> None:
    """Heads, which come at once, do not stand for whole replies; nor does the pause behind them go unseen."""
    make, frame = MASTERS[kind]
    head = {"rtu": 5, "ascii": 11}[kind]
    clock = InstantClock()
    port = PausingPort(clock, frame)
    port.pause_s, port.behind = PAUSE_S, head if at == "head" else head + 1
    line = make(StreamLine(port, TIMEOUT_S, 0.001, clock))
    assert {outcome(line) for _ in range(3 * FEWEST)} == {"ok"}


@pytest.mark.parametrize("kind", MASTERS)
def test_heads_do_not_count_as_replies(kind: str) -> None:
    make, frame = MASTERS[kind]
    clock = InstantClock()
    stream = StreamLine(PausingPort(clock, frame), TIMEOUT_S, 0.001, clock)
    line = make(stream)
    for _ in range(FEWEST - 1):
        assert outcome(line) == "ok"
    assert stream._rest.wait_s == TIMEOUT_S
    assert outcome(line) == "ok"
    assert stream._rest.wait_s == MIN_REST * TIMEOUT_S


@pytest.mark.parametrize("kind", MASTERS)
def test_the_whole_timeout_is_waited_until_a_frame_is_whole(kind: str) -> None:
    make, frame = MASTERS[kind]
    clock = InstantClock()
    port = PausingPort(clock, frame)
    stream = StreamLine(port, TIMEOUT_S, 0.001, clock)
    line = make(stream)
    for _ in range(FEWEST):
        outcome(line)
    port.frame = frame[:-1]
    waits_s = []
    for _ in range(MAX_IN_VAIN + 3):
        waits_s.append(stream._rest.wait_s)
        assert outcome(line) == str(Quality.INCOMPLETE)
    assert waits_s == MAX_IN_VAIN * [MIN_REST * TIMEOUT_S] + 3 * [TIMEOUT_S]
    port.frame = frame
    assert {outcome(line) for _ in range(FEWEST)} == {"ok"}
    assert stream._rest.wait_s == MIN_REST * TIMEOUT_S


def test_what_came_of_a_frame_is_told_with_its_head() -> None:
    clock = InstantClock()
    port = PausingPort(clock, RTU_FRAME[:8])
    line = RtuMaster(StreamLine(port, TIMEOUT_S, 0.001, clock), ask_one_more=False)
    with pytest.raises(LineFault, match="only 8 bytes") as caught:
        line.read_registers(UNIT, 4, 10, len(REGISTERS))
    assert repr(RTU_FRAME[:8]) in caught.value.detail
