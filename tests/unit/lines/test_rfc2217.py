"""rfc2217://: a serial device server at the other end, played by pyserial's own PortManager on a pty."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import tty
from collections.abc import Iterator
from typing import Any

import pytest
import serial
from serial.rfc2217 import PortManager

from compd.gauge import LineFault, Quality
from compd.lines import open_line
from compd.live.acquisition import Acquisition
from compd.live.system import THIS_COMPUTER
from tests.support.ascii_gauge import gauge
from tests.support.patience import PATIENCE_S
from tests.support.wire_rig import SETTINGS, WatchedLatest

# pyserial's client names its thread in a way that Python has given up, and leaves its socket to the garbage collector
# where the server has gone.
pytestmark = pytest.mark.filterwarnings(
    "ignore:setDaemon:DeprecationWarning",
    "ignore:setName:DeprecationWarning",
    "ignore::pytest.PytestUnraisableExceptionWarning",
)


class PtySerial(serial.Serial):
    """A pty has none of the lines of a modem."""

    cts = dsr = ri = cd = property(lambda self: False)
    rts = dtr = property(lambda self: True, lambda self, value: None)

    def _update_rts_state(self) -> None:
        """None."""

    def _update_dtr_state(self) -> None:
        """None."""


class Connection:
    """What PortManager writes to."""

    def __init__(self, client: socket.socket) -> None:
        self.write = client.sendall


class DeviceServer:
    """One client at a time; behind it a device that answers `?` CR."""

    def __init__(self) -> None:
        self.settings: dict[str, Any] = {}
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self._serial = PtySerial(os.ttyname(slave))
        os.close(slave)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"rfc2217://127.0.0.1:{self._listener.getsockname()[1]}"
        self._client: socket.socket | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def hang_up(self) -> None:
        """Close the connection of the client."""
        if self._client is not None:
            with contextlib.suppress(OSError):  # the client has gone itself
                self._client.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self.hang_up()
        self._thread.join(PATIENCE_S)
        self._listener.close()
        self._serial.close()
        os.close(self._master)

    def _run(self) -> None:
        while True:
            try:
                self._client, _ = self._listener.accept()
            except OSError:
                return
            with self._client, contextlib.suppress(OSError):
                self._serve(self._client)

    def _serve(self, client: socket.socket) -> None:
        manager = PortManager(self._serial, Connection(client))
        while True:
            ready, _, _ = select.select([client, self._master, self._serial.fd], [], [])
            if client in ready:
                data = client.recv(1024)
                if not data:
                    return
                self._serial.write(b"".join(manager.filter(data)))
                self.settings = {"baud": self._serial.baudrate, "parity": self._serial.parity}
            if self._serial.fd in ready:
                client.sendall(b"".join(manager.escape(self._serial.read(self._serial.in_waiting))))
            if self._master in ready and os.read(self._master, 100) == b"?\r":
                os.write(self._master, b"+01.250\r\n")


@pytest.fixture
def server() -> Iterator[DeviceServer]:
    server = DeviceServer()
    yield server
    server.close()


def settings(url: str) -> Any:
    keys = {"kind": "serial", "port": url, "baud": 19200, "format": "8N1", "timeout_s": 1.0, "back_off_s": (0.05, 0.1)}
    return SETTINGS.validate_python(keys)


@pytest.mark.long
@pytest.mark.sample
def test_a_gauge_behind_a_device_server_is_read_and_found_again(server: DeviceServer) -> None:
    dial = gauge(**{"out": "?", "out_terminator": r"\r", "in": "%+07.3f", "in_terminator": r"\r\n"})
    latest = WatchedLatest(["dial.value"])
    lines = {"line": (settings(server.url), [("dial", dial)])}
    acquisition = Acquisition(lines, {"dial": 5.0}, latest, THIS_COMPUTER)
    acquisition.start()
    try:
        assert latest.wait_for("dial.value", Quality.OK).value == 1.25
        assert server.settings == {"baud": 19200, "parity": "N"}
        since = latest.now
        server.hang_up()
        latest.wait_for("dial.value", Quality.LINE_LOST, since)
        assert latest.wait_for("dial.value", Quality.OK, latest.now).value == 1.25
    finally:
        assert acquisition.stop(PATIENCE_S)


def test_a_device_server_that_is_not_there_is_a_lost_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        url = f"rfc2217://127.0.0.1:{listener.getsockname()[1]}"
    with pytest.raises(LineFault, match=url) as caught:
        open_line(settings(url), THIS_COMPUTER)
    assert caught.value.quality is Quality.LINE_LOST
