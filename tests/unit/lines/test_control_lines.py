"""DTR, RTS, break and the direction of RS-485: what reaches a port, and what is said where the port has none."""

from __future__ import annotations

import fcntl
import os
import socket
import struct
import termios
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError
from structlog.testing import capture_logs

from compd.clock import MonotonicClock
from compd.gauge import LineFault, Quality
from compd.line_settings import powered
from compd.lines import open_line
from compd.lines.control_lines import ControlLines
from compd.lines.port import TcpPort
from compd.lines.stream import StreamLine
from tests.support.ascii_gauge import gauge, line_with
from tests.support.patience import PATIENCE_S
from tests.support.wire_rig import SETTINGS, InstantClock, ScriptedPort

# pyserial's client names its thread in a way that Python has given up.
pytestmark = pytest.mark.filterwarnings("ignore:setDaemon:DeprecationWarning", "ignore:setName:DeprecationWarning")

# RFC 2217 and Telnet, RFC 854
IAC, SE, SB, WILL, WONT, DO, DONT = 255, 240, 250, 251, 252, 253, 254
COM_PORT_OPTION = 44
SET_CONTROL = 5
CONTROLS = {5: "break on", 6: "break off", 8: "dtr high", 9: "dtr low", 11: "rts high", 12: "rts low"}


class Rfc2217Peer:
    """A device server of our own, which notes what is set on its port's control lines and repeats every order, as the
    protocol wants. A rise of DTR asks the device behind it."""

    def __init__(self) -> None:
        self.controls: list[str] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"rfc2217://127.0.0.1:{self._listener.getsockname()[1]}"
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._listener.close()
        self._thread.join(PATIENCE_S)

    def _run(self) -> None:
        client, _ = self._listener.accept()
        with client:
            heard = b""
            while data := client.recv(1024):
                heard = self._receive(client, heard + data)

    def _receive(self, client: socket.socket, heard: bytes) -> bytes:
        """Answer every whole command; what is left of the last one."""
        while (start := heard.find(IAC)) >= 0 and len(heard) >= start + 3:
            command = heard[start + 1]
            if command in (DO, WILL):
                client.sendall(bytes([IAC, WILL if command == DO else DO, heard[start + 2]]))
                heard = heard[start + 3 :]
            elif command == SB and (end := heard.find(bytes([IAC, SE]), start)) >= 0:
                self._order(client, heard[start + 2 : end])
                heard = heard[end + 2 :]
            elif command in (WONT, DONT):
                heard = heard[start + 3 :]
            else:
                break
        return heard

    def _order(self, client: socket.socket, order: bytes) -> None:
        option, number, value = order[0], order[1], order[2:]
        if option != COM_PORT_OPTION:
            return
        client.sendall(bytes([IAC, SB, option, number + 100]) + value + bytes([IAC, SE]))
        if number == SET_CONTROL and value[0] in CONTROLS:
            self.controls.append(CONTROLS[value[0]])
            if self.controls[-2:] == ["dtr low", "dtr high"]:
                client.sendall(b"+01.250\r")


@pytest.fixture
def peer() -> Iterator[Rfc2217Peer]:
    peer = Rfc2217Peer()
    yield peer
    peer.close()


def settings(port: str, **keys: Any) -> Any:
    return SETTINGS.validate_python(
        {"kind": "serial", "port": port, "baud": 4800, "format": "7E2", "timeout_s": 2.0, **keys}
    )


def test_dtr_and_rts_are_set_at_opening(peer: Rfc2217Peer) -> None:
    with closing(open_line(settings(peer.url, dtr=True, rts=False), MonotonicClock())):
        assert "rts low" in peer.controls
        assert "rts high" not in peer.controls
        assert "dtr low" not in peer.controls


def test_what_is_left_out_is_high_as_ever(peer: Rfc2217Peer) -> None:
    with closing(open_line(settings(peer.url), MonotonicClock())):
        assert {"dtr high", "rts high"} <= set(peer.controls)


def test_a_device_is_asked_by_a_pulse_of_dtr(peer: Rfc2217Peer) -> None:
    dial = gauge(**{"out": "", "out_terminator": "", "in": "%f", "in_terminator": r"\r", "dtr_pulse_s": 0.01})
    line: Any = open_line(settings(peer.url, dtr=True, rts=True), MonotonicClock())
    with closing(line):
        assert dial.read(line)[0].value == 1.25
        assert peer.controls[-2:] == ["dtr low", "dtr high"]


def test_a_break_before_a_request(peer: Rfc2217Peer) -> None:
    line: Any = open_line(settings(peer.url), MonotonicClock())
    with closing(line):
        line.send_break(0.01)
        assert peer.controls[-2:] == ["break on", "break off"]


def test_the_pulse_lasts_as_long_as_the_manual_asks_and_dates_the_reading() -> None:
    dial = gauge(**{"out": "", "out_terminator": "", "in": "%f", "dtr_pulse_s": 0.12})
    clock = InstantClock()
    port = ScriptedPort(clock)
    line = StreamLine(port, 0.5, 0.002, clock)
    low_s: list[float] = []
    clock.on_wait = lambda: (low_s.append(clock.now_s), port.script.append(b"+1.5\r\n"))
    (reading,) = dial.read(line)
    assert port.control == ["dtr low", "dtr high"]
    assert clock.waits_s == [0.12]
    assert reading.time_s == pytest.approx(low_s[0] - 0.12), "the device may sample as soon as DTR is low"


def test_a_break_comes_before_every_request() -> None:
    line, port = line_with(device=lambda request: b"+1.5\r\n")
    device = gauge(**{"in": "%f", "break_s": 0.002})
    device.read(line)
    device.read(line)
    assert port.control == ["break on", "break off"] * 2
    assert port.written == [b"?\r"] * 2


def test_a_tcp_connection_has_none() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = TcpPort(*listener.getsockname(), 1.0)
        for call in (port.set_dtr, port.set_break):
            with pytest.raises(LineFault, match="TCP connection has no") as caught:
                call(True)
            assert caught.value.quality is Quality.LINE_LOST
        port.close()


def test_a_port_without_them_is_opened_and_the_log_says_so() -> None:
    master, slave = os.openpty()
    name = os.ttyname(slave)
    with capture_logs() as logs:
        line: Any = open_line(settings(name, dtr=True, rts=False), MonotonicClock())
    assert [entry["event"] for entry in logs] == ["DTR, RTS or RS-485 not granted"]
    with pytest.raises(LineFault, match="no DTR on this port"):
        line.pulse_dtr(0.01)
    line.close()
    os.close(master)
    os.close(slave)


def test_the_direction_of_rs485_is_handed_to_the_system(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A fake port: no hardware with this mode was at hand."""
    asked: list[tuple[int, tuple[int, ...]]] = []

    class FakePort:
        def fileno(self) -> int:
            return file.fileno()

        rs485_mode: Any = None

    class Rs485:
        rts_when_sending, delay_before_s, delay_after_s = True, 0.001, 0.002

    def ioctl(fd: int, request: int, argument: bytes) -> bytes:
        asked.append((request, struct.unpack("I", argument)))
        return argument

    monkeypatch.setattr(fcntl, "ioctl", ioctl)
    with (tmp_path / "port").open("wb") as file:
        fake = FakePort()
        assert ControlLines(rts=False).check(fake) == ""
        assert asked == [(termios.TIOCMGET, (0,))]
        assert ControlLines(rs485=Rs485()).check(fake) == ""
    mode = fake.rs485_mode
    assert (mode.rts_level_for_tx, mode.rts_level_for_rx) == (True, False)
    assert (mode.delay_before_tx, mode.delay_before_rx) == (0.001, 0.002)


def test_a_port_that_does_not_switch_the_direction() -> None:
    class Refusing:
        @property
        def rs485_mode(self) -> None:
            return None

        @rs485_mode.setter
        def rs485_mode(self, mode: Any) -> None:
            raise ValueError("Failed to set RS485 mode")

    rs485 = settings("/dev/x", rs485={}).rs485
    assert "Failed to set RS485 mode" in ControlLines(rs485=rs485).check(Refusing())


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ({"rts": True, "rs485": {}}, "contradict"),
        ({"port": "rfc2217://x:1", "rs485": {}}, "needs a port of this computer"),
        ({"port": "socket://x:1", "dtr": True}, "need a serial port"),
    ],
)
def test_lines_that_cannot_be_are_refused(keys: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        settings(**{"port": "/dev/x", **keys})


def test_a_line_is_powered_as_its_gauges_need_it() -> None:
    dial = gauge(**{"in": "%f", "line_needs": {"dtr": True, "rts": False}})
    left_out = powered(settings("/dev/x"), [dial])
    assert (left_out.dtr, left_out.rts) == (True, False)
    assert powered(settings("socket://x:1"), [dial]).rts is None, "the device server powers its port itself"
    tcp = SETTINGS.validate_python({"kind": "tcp", "host": "x", "port": 1, "timeout_s": 1})
    assert powered(tcp, [dial]) is tcp
