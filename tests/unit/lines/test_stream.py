"""A line of bytes: deadlines, quiet before a request, faults by name; on scripts, ptys and sockets."""

from __future__ import annotations

import itertools
import math
import os
import socket
import struct
import termios
import tty
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from compd.clock import MonotonicClock
from compd.gauge import LineFault, Quality
from compd.lines import WrappedPorts, open_line, open_stream
from compd.lines.kinds.modbus_rtu.master import RtuMaster
from compd.lines.port import Port, SerialPort, TcpPort
from compd.lines.stream import MAX_DRAIN_TIMEOUTS, MIN_REST, StreamLine
from compd.lines.usual_time import FEWEST, MAX_IN_VAIN, MIN_WAIT_S
from tests.support.wire_rig import SETTINGS, InstantClock, ScriptedPort

TIMEOUT_S = 0.1


def scripted(*script: bytes) -> tuple[StreamLine, ScriptedPort, InstantClock]:
    clock = InstantClock()
    port = ScriptedPort(clock, script)
    return StreamLine(port, TIMEOUT_S, 0.001, clock), port, clock


def fault_of(*script: bytes, terminator: bytes = b"\r\n") -> LineFault:
    line, _, _ = scripted(*script)
    with pytest.raises(LineFault) as caught:
        line.receive_until(terminator, 10)
    return caught.value


def test_pieces_make_a_reply() -> None:
    line, _, _ = scripted(b"AB", b"C", b"DEF")
    assert line.receive(4) == b"ABCD"
    assert line.receive(2) == b"EF"


def test_a_terminator_may_come_in_two_pieces() -> None:
    line, _, _ = scripted(b"12.5\r", b"\nX")
    assert line.receive_until(b"\r\n", 10) == b"12.5\r\n"
    assert line.receive(1) == b"X"


def test_silence_is_a_timeout_and_a_part_is_incomplete() -> None:
    assert fault_of().quality is Quality.TIMEOUT
    fault = fault_of(b"12.")
    assert fault.quality is Quality.INCOMPLETE
    assert "12." in fault.detail


def test_a_reply_that_does_not_end_is_a_mismatch() -> None:
    assert fault_of(b"123456", b"789012").quality is Quality.MISMATCH
    assert fault_of(b"123456789\r\n").quality is Quality.MISMATCH, "11 bytes are more than 10"


def test_bytes_that_dribble_in_do_not_stretch_the_deadline() -> None:
    line, port, clock = scripted()

    def dribble(timeout_s: float) -> bytes:
        clock.now_s += TIMEOUT_S / 4
        return b"1" if timeout_s > 0 else b""

    port.read = dribble  # type: ignore[method-assign]
    with pytest.raises(LineFault) as caught:
        line.receive(1000)
    assert caught.value.quality is Quality.INCOMPLETE


def test_what_comes_unsolicited_is_dropped_and_counted_before_a_request() -> None:
    line, port, _ = scripted(b"late rep", b"ly\r\n", b"", b"12.5\r\n")
    line.send(b"?")
    assert port.written == [b"?"]
    assert line.unexpected_bytes == 12
    assert line.receive_until(b"\r\n", 10) == b"12.5\r\n"


def test_the_rest_of_a_doubled_reply_is_not_the_next_answer() -> None:
    line, _, _ = scripted(b"1.0\r\n1.0\r\n")
    assert line.receive_until(b"\r\n", 10) == b"1.0\r\n"
    line.send(b"?")
    assert line.unexpected_bytes == 5
    with pytest.raises(LineFault, match="timeout"):
        line.receive_until(b"\r\n", 10)


def test_a_line_that_is_never_quiet_is_named() -> None:
    line, port, clock = scripted()

    def babble(timeout_s: float) -> bytes:
        clock.now_s += 0.01
        return b"x"

    port.read = babble  # type: ignore[method-assign]
    with pytest.raises(LineFault) as caught:
        line.send(b"?")
    assert caught.value.quality is Quality.MISMATCH
    assert port.written == []
    start_s = clock.now_s
    line.drain()
    assert clock.now_s - start_s < 2 * MAX_DRAIN_TIMEOUTS * TIMEOUT_S, "draining ends, too"


def test_drain_waits_for_quiet_and_gives_what_came() -> None:
    line, _, clock = scripted(b"late", b"r", b"", b"not reached")
    start_s = clock.now_s
    assert line.drain() == b"later"
    assert clock.now_s - start_s == pytest.approx(TIMEOUT_S)


def test_the_timeout_begins_when_the_request_has_left() -> None:
    """A request of 15 bytes takes 0.125 s at 1200 baud, longer than this timeout."""
    clock = InstantClock()
    port = ScriptedPort(clock)
    port.character_s = 10 / 1200
    line = StreamLine(port, TIMEOUT_S, 0.001, clock)
    sent_s = line.send(bytes(15))
    with pytest.raises(LineFault, match=r"no byte within 0\.1 s"):
        line.receive(1)
    assert clock.now_s == pytest.approx(sent_s + TIMEOUT_S)


def test_a_device_that_is_deaf_after_its_reply_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """`pause_s`: from the reply's last byte to the next request. This one hears nothing for 15 ms."""
    clock = InstantClock()
    replied_s = [-math.inf]

    def deaf(request: bytes) -> bytes:
        if clock.now_s - replied_s[0] < 0.015:
            return b""
        replied_s[0] = clock.now_s
        return b"+1.5\r\n"

    monkeypatch.setattr("compd.lines.port.TcpPort", lambda *_: ScriptedPort(clock, device=deaf))
    answers = {}
    for pause_s in (0.0, 0.015):
        settings = {"kind": "tcp", "host": "x", "port": 1, "timeout_s": TIMEOUT_S, "pause_s": pause_s}
        line: Any = open_line(SETTINGS.validate_python(settings), clock)
        replied_s[0] = -math.inf
        answers[pause_s] = 0
        for _ in range(10):
            line.send(b"?")
            with suppress(LineFault):
                line.receive_until(b"\r\n", 10)
                answers[pause_s] += 1
    assert answers[0.015] == 10
    assert answers[0.0] < 10


# --- real ptys and sockets ---------------------------------------------------------------------------------


@pytest.fixture
def pty() -> Iterator[tuple[int, str]]:
    """A master's descriptor and the name of the other side."""
    master, slave = os.openpty()
    tty.setraw(slave)
    name = os.ttyname(slave)
    os.close(slave)
    yield master, name
    try:
        os.close(master)
    except OSError:
        return  # the test has pulled the plug itself


def serial_line(name: str, form: str = "8N1") -> StreamLine:
    settings = SETTINGS.validate_python(
        {"kind": "serial", "port": name, "baud": 9600, "format": form, "timeout_s": TIMEOUT_S, "low_latency": True}
    )
    line = open_line(settings, MonotonicClock())
    assert isinstance(line, StreamLine)
    return line


@pytest.mark.parametrize("form", ["8N1", "7E2", "7O1", "8E1"])
def test_every_format_talks_on_a_pty(pty: tuple[int, str], form: str) -> None:
    master, name = pty
    line = serial_line(name, form)
    before_s = MonotonicClock().monotonic()
    time_s = line.send(b"?\r")
    assert os.read(master, 10) == b"?\r"
    assert time_s >= before_s + 2 * 10 / 9600, "the request's own time on the wire counts"
    os.write(master, b"1.5\r\n")
    assert line.receive_until(b"\r\n", 10) == b"1.5\r\n"
    line.close()


class ShownPort:
    """A port that keeps what was written to it."""

    def __init__(self, port: Port) -> None:
        self.character_s = port.character_s
        self.written = b""
        self._port = port

    def read(self, timeout_s: float) -> bytes:
        return self._port.read(timeout_s)

    def write(self, data: bytes) -> None:
        self.written += data
        self._port.write(data)

    def close(self) -> None:
        self._port.close()


@pytest.mark.parametrize("kind", ["serial", "modbus_rtu"])
def test_a_line_over_a_wrapped_port_is_otherwise_the_same(pty: tuple[int, str], kind: str) -> None:
    master, name = pty
    ports: list[ShownPort] = []

    def wrap(port: Port) -> ShownPort:
        ports.append(ShownPort(port))
        return ports[-1]

    settings = SETTINGS.validate_python(
        {"kind": kind, "port": name, "baud": 9600, "format": "8N1", "timeout_s": TIMEOUT_S}
    )
    plain = open_line(settings, MonotonicClock())
    plain.close()
    stream = plain._stream if isinstance(plain, RtuMaster) else plain
    assert isinstance(stream, StreamLine)
    shown = open_stream(settings, MonotonicClock(), WrappedPorts(wrap))
    assert shown._gap_s == stream._gap_s, "the silence before a request"
    shown.send(b"?\r")
    assert os.read(master, 10) == b"?\r" == ports[0].written
    shown.close()


def test_a_character_with_a_wrong_parity_is_asked_to_read_as_nul(pty: tuple[int, str]) -> None:
    _, name = pty
    line = serial_line(name, "7E2")
    fd = os.open(name, os.O_RDWR | os.O_NOCTTY)
    flags = termios.tcgetattr(fd)[0]
    os.close(fd)
    line.close()
    assert flags & termios.INPCK
    assert not flags & (termios.IGNPAR | termios.PARMRK)


def test_pulling_the_plug_loses_the_line_in_every_call(pty: tuple[int, str]) -> None:
    master, name = pty
    line = serial_line(name)
    os.close(master)
    for call in (lambda: line.send(b"?"), lambda: line.receive(1), line.drain):
        with pytest.raises(LineFault) as caught:
            call()
        assert caught.value.quality is Quality.LINE_LOST
    line.close()


def test_a_port_that_is_not_there_is_named_once(tmp_path) -> None:
    name = str(tmp_path / "ttyUSB7")
    with pytest.raises(LineFault) as caught:
        SerialPort(name, 9600, "8N1", False, TIMEOUT_S)
    assert str(caught.value).endswith(f"cannot open {name}: No such file or directory")


def test_a_write_to_a_pulled_plug_loses_the_line(pty: tuple[int, str]) -> None:
    master, name = pty
    port = SerialPort(name, 9600, "8N1", False, TIMEOUT_S)
    os.close(master)
    with pytest.raises(LineFault) as caught:
        port.write(b"?")
    assert caught.value.quality is Quality.LINE_LOST
    port.close()


def test_a_port_that_takes_no_bytes_is_a_fault_of_the_poll_and_not_a_lost_line(pty: tuple[int, str]) -> None:
    _, name = pty
    port = SerialPort(name, 9600, "8N1", False, 0.01)
    with pytest.raises(LineFault, match="could not be written within") as caught:
        port.write(bytes(1_000_000))  # nobody reads the other end
    assert caught.value.quality is Quality.TIMEOUT
    port.close()


def test_a_busy_computer_is_no_fault_of_a_request_that_has_left(
    pty: tuple[int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process has no processor from before a write until long after its timeout: the bytes are out all the same."""
    master, name = pty
    port = SerialPort(name, 9600, "8N1", False, 0.1)
    now_s = itertools.count(0.0, 1.0)  # a second passes from one look at the clock to the next
    monkeypatch.setattr("time.monotonic", lambda: next(now_s))
    port.write(b"?\r")
    monkeypatch.undo()
    assert os.read(master, 10) == b"?\r"
    port.close()


@pytest.mark.parametrize("port", ["/dev/nowhere", "socket://127.0.0.1:1", "nonsense://x"])
def test_what_cannot_be_opened_is_a_lost_line_with_its_name(port: str) -> None:
    with pytest.raises(LineFault) as caught:
        serial_line(port)
    assert caught.value.quality is Quality.LINE_LOST
    assert port in caught.value.detail


def test_a_directory_is_not_a_port(tmp_path: Path) -> None:
    with pytest.raises(LineFault, match="line_lost"):
        serial_line(str(tmp_path))


def test_a_port_without_a_descriptor_keeps_its_deadlines() -> None:
    line = serial_line("loop://")
    line.send(b"12.5\r\n")
    assert line.receive_until(b"\r\n", 10) == b"12.5\r\n"
    with pytest.raises(LineFault, match="timeout"):
        line.receive(1)
    line.close()


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener


@pytest.mark.parametrize("by_url", [False, True])
def test_tcp_lines_talk_and_are_lost_when_the_device_closes(server: socket.socket, by_url: bool) -> None:
    host, number = server.getsockname()
    where = {"kind": "tcp", "host": host, "port": number}
    if by_url:
        where = {"kind": "serial", "port": f"socket://{host}:{number}", "baud": 9600, "format": "8N1"}
    line = open_line(SETTINGS.validate_python({**where, "timeout_s": TIMEOUT_S}), MonotonicClock())
    assert isinstance(line, StreamLine)
    device, _ = server.accept()
    with device:
        line.send(b"MS\r\n")
        assert device.recv(10) == b"MS\r\n"
        device.sendall(b"1.5\r\n")
        assert line.receive_until(b"\r\n", 10) == b"1.5\r\n"
    with pytest.raises(LineFault) as caught:
        line.receive(1)
    assert caught.value.quality is Quality.LINE_LOST
    line.close()


def test_a_socket_whose_other_end_has_reset_it_is_closed(server: socket.socket) -> None:
    host, number = server.getsockname()
    port = SerialPort(f"socket://{host}:{number}", 9600, "8N1", low_latency=False, write_timeout_s=1.0)
    connection = port._port._socket
    device, _ = server.accept()
    device.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    device.close()
    with pytest.raises(ConnectionResetError):
        connection.recv(1)
    port.close()
    assert connection.fileno() == -1


def test_tcp_refused_is_a_lost_line() -> None:
    with pytest.raises(LineFault) as caught:
        TcpPort("127.0.0.1", 1, TIMEOUT_S)
    assert caught.value.quality is Quality.LINE_LOST


def test_the_rest_of_a_reply_is_waited_for_half_of_the_timeout_and_after_that_for_all_of_it() -> None:
    """A device that has become slower is not given up time and again."""
    clock = InstantClock()
    port = ScriptedPort(clock, [b"+1.234\r\n"] * FEWEST)
    line = StreamLine(port, 0.15, 0.0, clock)
    assert line._rest.wait_s == 0.15
    for _ in range(FEWEST):
        line.receive(8)
    assert line._rest.wait_s == MIN_REST * 0.15
    for waited_s in (*[MIN_REST * 0.15] * MAX_IN_VAIN, 0.15, 0.15):
        port.script, start_s = [b"+1.23"], clock.now_s
        with pytest.raises(LineFault) as caught:
            line.receive(8)
        assert caught.value.quality is Quality.INCOMPLETE
        assert clock.now_s - start_s == pytest.approx(waited_s)
        line.drain(0.0)
    port.script = [b"+1.234\r\n"] * FEWEST
    for _ in range(FEWEST):
        line.receive(8)
    assert line._rest.wait_s == MIN_REST * 0.15, "whole replies came"


def test_a_reply_is_waited_for_three_times_as_long_as_usual_and_the_silence_after_it_as_long_as_ever() -> None:
    """What is late by more than that is still not taken for the answer to the next request."""
    clock = InstantClock()
    replies = [b"1\r\n"] * FEWEST
    line = StreamLine(ScriptedPort(clock, device=lambda _: replies.pop() if replies else b""), 0.15, 0.0, clock)
    for _ in range(FEWEST):
        line.send(b"?")
        line.receive(3)
    line.send(b"?")
    start_s = clock.now_s
    with pytest.raises(LineFault, match=f"no byte within {MIN_WAIT_S:g} s"):
        line.receive(3)
    assert clock.now_s - start_s == pytest.approx(MIN_WAIT_S)
    line.drain()
    assert clock.now_s - start_s == pytest.approx(2 * 0.15)
