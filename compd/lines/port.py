"""Ports, which move a line's bytes: a serial port (device or pyserial URL), or a TCP connection.

A port waits in `select`, so that a waiting thread takes no processor time. It raises LineFault (LINE_LOST) for all that
the system reports when a plug is pulled; after that a new port must be opened.
"""

from __future__ import annotations

import os
import re
import select
import socket
import termios
from contextlib import suppress
from typing import Protocol

import serial
import structlog

from compd.gauge import LineFault, Quality
from compd.lines.control_lines import ControlLines

log = structlog.get_logger()

# Pulling a plug raises SerialException (an OSError), a plain OSError or termios.error, depending on the call.
PORT_FAULTS = (OSError, termios.error)
MAX_BYTES = 4096  # of one read: far more than any reply
# Polling interval (s) of ports without a file descriptor (rfc2217://, loop://), for which `select` cannot wait.
SLICE_S = 5e-3


def _why(error: Exception, port: str) -> str:
    """The reason of an error of pyserial, which nests the system's text with its number and the port's name."""
    text = re.sub(r"\[Errno -?\d+\] ", "", str(error))
    text = text.removeprefix(f"could not open port {port}: ").removesuffix(f": {port!r}")
    return text or type(error).__name__


class Port(Protocol):
    """Bytes in and out. `character_s`: time (s) that one character takes on the wire; 0 if unknown."""

    character_s: float

    def read(self, timeout_s: float) -> bytes:
        """What has come, as soon as a byte has; b"" after `timeout_s` without one."""
        ...

    def write(self, data: bytes) -> None:
        """Write all of `data`."""
        ...

    def set_dtr(self, high: bool) -> None:
        """Set DTR. Raises LineFault (LINE_LOST) if the port has none."""
        ...

    def set_break(self, on: bool) -> None:
        """Begin or end a break. Raises LineFault (LINE_LOST) if the port has none."""
        ...

    def close(self) -> None:
        """Close the port, which is of no further use."""
        ...


class NetworkPort(Port, Protocol):
    """A port of a network."""

    @property
    def peer(self) -> str:
        """Address and port of the other end; "" if the connection has ended."""
        ...


class SerialPort:
    """A serial port. All its parameters are set when it is opened; only DTR and break change while it is open."""

    def __init__(
        self,
        port: str,
        baud: int,
        form: str,
        low_latency: bool,
        write_timeout_s: float,
        control: ControlLines = ControlLines(),  # noqa: B008  a NamedTuple of None
    ) -> None:
        """`port`: device path or pyserial URL; `form`: data bits, parity and stop bits, as "8N1" or "7E2".

        `write_timeout_s`: how long the port may take no byte, s; not watched over rfc2217://. `control`: DTR, RTS and
        the direction of RS-485; a device without them is opened all the same, and the log says so.

        Raises LineFault (LINE_LOST) when it cannot be opened.
        """
        data_bits, parity, stop_bits = int(form[0]), form[1], int(form[2])
        is_device = "://" not in port
        try:
            self._port = serial.serial_for_url(
                port,
                baudrate=baud,
                bytesize=data_bits,
                parity=parity,
                stopbits=stop_bits,
                timeout=SLICE_S,
                exclusive=True if is_device else None,
                do_not_open=True,
            )
            control.prepare(self._port)
            self._port.open()
        except Exception as error:  # of a URL, it is anything that its handler or the network raises
            raise LineFault(Quality.LINE_LOST, f"cannot open {port}: {_why(error, port)}") from error
        # Behind a URL the device server sets the baud rate, and the time of a character is unknown here.
        bits = 1 + data_bits + (parity != "N") + stop_bits
        self.character_s = bits / baud if is_device else 0.0
        self._write_timeout_s = write_timeout_s
        self._fd: int | None = None if port.startswith(("rfc2217:", "loop:")) else self._port.fileno()
        if is_device:
            try:
                if parity != "N":
                    self._check_parity()
                if low_latency:
                    with suppress(ValueError):  # of an adapter, or a pty, that has no latency timer
                        self._port.set_low_latency_mode(True)
                if refused := control.check(self._port):
                    log.warning("DTR, RTS or RS-485 not granted", port=port, reason=refused)
            except PORT_FAULTS as error:
                self._port.close()
                raise LineFault(Quality.LINE_LOST, f"cannot set up {port}: {error}") from error

    def _check_parity(self) -> None:
        """Make a character with a wrong parity read as NUL, which no reply contains (termios(3), INPCK).

        pyserial leaves the check off, and a damaged digit would be taken for another digit.
        """
        fd = self._port.fileno()
        attributes = termios.tcgetattr(fd)
        attributes[0] = (attributes[0] | termios.INPCK) & ~(termios.IGNPAR | termios.PARMRK)
        termios.tcsetattr(fd, termios.TCSANOW, attributes)

    def read(self, timeout_s: float) -> bytes:
        try:
            if self._fd is None:
                return self._read_in_slices(timeout_s)
            if not select.select([self._fd], [], [], max(0.0, timeout_s))[0]:
                return b""
            data = os.read(self._fd, MAX_BYTES)
        except PORT_FAULTS as error:
            raise LineFault(Quality.LINE_LOST, f"read: {error}") from error
        if not data:  # an unplugged adapter is always ready and has no bytes
            raise LineFault(Quality.LINE_LOST, "read: the port has hung up")
        return data

    def _read_in_slices(self, timeout_s: float) -> bytes:
        """`read` for a port without a file descriptor."""
        for _ in range(int(timeout_s / SLICE_S) + 1):
            if first := bytes(self._port.read(1)):
                return first + bytes(self._port.read(self._port.in_waiting))
        return b""

    def write(self, data: bytes) -> None:
        try:
            if self._fd is None:
                self._port.write(data)
            elif unsent := self._write_in_time(self._fd, data):
                self._port.reset_output_buffer()  # or the rest of a request would leave with the next one
                text = f"{len(unsent)} of {len(data)} bytes could not be written within {self._write_timeout_s:g} s"
                raise LineFault(Quality.TIMEOUT, text)
        except PORT_FAULTS as error:
            raise LineFault(Quality.LINE_LOST, f"write: {error}") from error

    def _write_in_time(self, fd: int, data: bytes) -> bytes:
        """Write `data`; what the port did not take. Only a port that takes nothing is late, not a computer that is.

        pyserial's own timeout also ends a write that is complete, where the computer was busy in between.
        """
        while data and select.select([], [fd], [], self._write_timeout_s)[1]:
            try:
                data = data[os.write(fd, data) :]
            except BlockingIOError:
                continue
        return data

    def set_dtr(self, high: bool) -> None:
        try:
            self._port.dtr = high
        except PORT_FAULTS as error:
            raise LineFault(Quality.LINE_LOST, f"no DTR on this port: {error}") from error

    def set_break(self, on: bool) -> None:
        try:
            self._port.break_condition = on
        except PORT_FAULTS as error:
            raise LineFault(Quality.LINE_LOST, f"no break on this port: {error}") from error

    def close(self) -> None:
        connection = getattr(self._port, "_socket", None)
        try:
            self._port.close()
        except PORT_FAULTS as error:
            log.info("a lost port did not close cleanly", reason=str(error))
        if connection is not None:  # pyserial leaves it open where the other end has gone
            connection.close()


class TcpPort:
    """A TCP connection to a device or device server."""

    character_s = 0.0

    def __init__(self, host: str, port: int, timeout_s: float) -> None:
        """Connect within `timeout_s`. Raises LineFault (LINE_LOST) when the device cannot be reached."""
        try:
            self._socket = socket.create_connection((host, port), timeout=timeout_s)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            # A device that lost its power closes nothing: without this the kernel retries for a quarter of an hour.
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, max(1000, int(5000 * timeout_s)))
        except OSError as error:
            raise LineFault(Quality.LINE_LOST, f"cannot connect to {host}:{port}: {error}") from error

    @property
    def peer(self) -> str:
        try:
            address, port = self._socket.getpeername()[:2]
        except OSError:
            return ""
        return f"[{address}]:{port}" if ":" in address else f"{address}:{port}"

    def read(self, timeout_s: float) -> bytes:
        try:
            if not select.select([self._socket], [], [], max(0.0, timeout_s))[0]:
                return b""
            data = self._socket.recv(MAX_BYTES)
        except OSError as error:
            raise LineFault(Quality.LINE_LOST, f"read: {error}") from error
        if not data:
            raise LineFault(Quality.LINE_LOST, "read: the device closed the connection")
        return data

    def write(self, data: bytes) -> None:
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise LineFault(Quality.LINE_LOST, f"write: {error}") from error

    def set_dtr(self, high: bool) -> None:
        raise LineFault(Quality.LINE_LOST, "a TCP connection has no DTR: use a serial port, or rfc2217://")

    def set_break(self, on: bool) -> None:
        raise LineFault(Quality.LINE_LOST, "a TCP connection has no break: use a serial port, or rfc2217://")

    def close(self) -> None:
        self._socket.close()
