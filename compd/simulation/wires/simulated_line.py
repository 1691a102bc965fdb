"""A simulated line: its devices on a real pty or TCP port, at the line's baud rate, and its faults.

A serial line is a pty whose replies come at the baud rate; a TCP line is a listening socket on this computer. The
daemon opens either as it would the real one.
"""

from __future__ import annotations

import os
import select
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from pymodbus.framer.ascii import FramerAscii
from pymodbus.framer.rtu import FramerRTU

from compd.clock import Clock, MonotonicClock
from compd.configuration import PolledLine, SerialPortSettings, TriggerBytes, TriggerWrite
from compd.simulation.wires.device import SimulatedByteDevice, SimulatedRegisterDevice
from compd.simulation.wires.latch import Latch, TriggeredDevices
from compd.simulation.wires.line_fault import SILENT, UNPLUGGED, checked_fault
from compd.simulation.wires.modbus_slaves import ModbusSlaves
from compd.simulation.wires.wire_ends import LOOPBACK, End, PtyEnd, TcpEnd

# Replies are written in pieces of this duration; shorter pieces would only cost processor time.
PIECE_S = 1e-3
DAMAGED_BIT = 0x80

# A fault's effect on a reply.
Damage = Callable[[bytes], bytes]


def _garble(reply: bytes) -> bytes:
    """Invert the high bit in the middle: invalid in a text protocol, and found by a CRC."""
    middle = len(reply) // 2
    return reply[:middle] + bytes([reply[middle] ^ DAMAGED_BIT]) + reply[middle + 1 :]


def _garble_header(reply: bytes) -> bytes:
    """Modbus TCP: damage the frame's protocol number; TCP's own checksum protects the rest against noise."""
    return reply[:2] + bytes([reply[2] ^ DAMAGED_BIT]) + reply[3:]


def _other_unit_rtu(reply: bytes) -> bytes:
    frame = bytes([reply[0] % 247 + 1]) + reply[1:-2]
    return frame + FramerRTU.compute_CRC(frame).to_bytes(2, "big")


def _other_unit_ascii(reply: bytes) -> bytes:
    frame = bytearray(bytes.fromhex(reply[1:-4].decode()))
    frame[0] = frame[0] % 247 + 1
    return b":" + (bytes(frame) + bytes([FramerAscii.compute_LRC(bytes(frame))])).hex().upper().encode() + b"\r\n"


def _other_unit_tcp(reply: bytes) -> bytes:
    return reply[:6] + bytes([reply[6] % 247 + 1]) + reply[7:]


# Delay of a reply with the fault "late", in line timeouts.
LATE_TIMEOUTS = 1.5
_COMMON: Mapping[str, Damage] = {
    SILENT: lambda reply: b"",
    "garble": _garble,
    "late": lambda reply: reply,
    "cut": lambda reply: reply[: len(reply) // 2],
    "doubled": lambda reply: reply + reply,
    "noise before": lambda reply: b"\xff" + reply,
}
DAMAGES: Mapping[str, Mapping[str, Damage]] = {
    "serial": _COMMON,
    "tcp": _COMMON,
    "modbus_rtu": {**_COMMON, "wrong unit": _other_unit_rtu},
    "modbus_ascii": {**_COMMON, "wrong unit": _other_unit_ascii},
    "modbus_tcp": {**_COMMON, "garble": _garble_header, "wrong unit": _other_unit_tcp},
}


class Listener(Protocol):
    """Receives a line's bytes and returns replies."""

    def receive(self, data: bytes) -> bytes: ...


class ByteDevices:
    """Devices on a line of bytes: each receives everything."""

    def __init__(self, devices: Sequence[SimulatedByteDevice]) -> None:
        self._devices = devices

    def receive(self, data: bytes) -> bytes:
        return b"".join(device.receive(data) for device in self._devices)


@dataclass
class _Reply:
    """A reply under way: transmission starts at start_s to fd; `sent` bytes of it are written."""

    start_s: float
    fd: int
    data: bytes
    sent: int = 0


class SimulatedLine:
    """One configured line with its devices, served by a thread of its own."""

    def __init__(
        self,
        name: str,
        settings: PolledLine,
        devices: Sequence[SimulatedByteDevice] | Sequence[SimulatedRegisterDevice],
        directory: Path,
        clock: Clock | None = None,
    ) -> None:
        """directory : where a serial line's port appears, as `name`."""
        self.replies = 0  # number of replies, including those that a fault suppresses
        self._settings = settings
        self._clock = clock or MonotonicClock()
        self._link = directory / name
        self._damages = DAMAGES[settings.kind]
        self._listener: Listener
        latch = Latch(devices) if settings.round_trigger is not None else None
        if settings.kind.startswith("modbus"):
            registers = [device for device in devices if isinstance(device, SimulatedRegisterDevice)]
            self._listener = ModbusSlaves(
                registers,
                over_tcp=settings.kind == "modbus_tcp",
                as_text=settings.kind == "modbus_ascii",
                trigger=settings.round_trigger if isinstance(settings.round_trigger, TriggerWrite) else None,
                latch=latch,
            )
        else:
            self._listener = ByteDevices([device for device in devices if isinstance(device, SimulatedByteDevice)])
            if latch is not None and isinstance(settings.round_trigger, TriggerBytes):
                self._listener = TriggeredDevices(self._listener, settings.round_trigger.request, latch)
        self._character_s = 0.0
        self._on_pty = isinstance(settings, SerialPortSettings) and "://" not in settings.port
        if isinstance(settings, SerialPortSettings) and self._on_pty:
            bits = 1 + int(settings.format[0]) + (settings.format[1] != "N") + int(settings.format[2])
            self._character_s = bits / settings.baud
        self._tcp_port = 0
        self._end: End | None = None
        self._replies: list[_Reply] = []
        self._fault: str | None = None
        self._requested_fault: str | None = None  # applied by the line's thread between two replies
        self._wake_read, self._wake_write = os.pipe()
        self._stopping = False
        self._applied = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"simulated {name}", daemon=True)

    def start(self) -> str | tuple[str, int]:
        """Open the port and serve it. Returns the port for the daemon: device path, pyserial URL, or (host, port)."""
        self._plug_in()
        self._thread.start()
        if self._on_pty:
            return str(self._link)
        if isinstance(self._settings, SerialPortSettings):
            return f"socket://{LOOPBACK}:{self._tcp_port}"
        return LOOPBACK, self._tcp_port

    def stop(self) -> None:
        """Close the port and end the thread."""
        self._stopping = True
        self._wake()
        self._thread.join()
        os.close(self._wake_read)
        os.close(self._wake_write)

    @property
    def faults(self) -> tuple[str, ...]:
        """Faults that this kind of line can have."""
        return (*self._damages, UNPLUGGED)

    @property
    def fault(self) -> str | None:
        """The line's fault, or None. Setting it returns when the fault is applied."""
        return self._fault

    @fault.setter
    def fault(self, fault: str | None) -> None:
        wanted = checked_fault(fault, self.faults, self._settings.kind)
        if not self._thread.is_alive():
            raise RuntimeError("only a line that is served can have a fault: start it first")
        self._requested_fault = wanted
        self._applied.clear()
        self._wake()
        self._applied.wait()

    def _wake(self) -> None:
        os.write(self._wake_write, b"!")

    def _plug_in(self) -> None:
        if self._on_pty:
            self._end = PtyEnd(self._link)
        else:
            end = TcpEnd(self._tcp_port)
            self._tcp_port = end.port
            self._end = end

    def _pull_out(self) -> None:
        if self._end is not None:
            self._end.close()
        self._end = None
        self._replies.clear()

    def _run(self) -> None:
        while not self._stopping:
            fds = self._end.fds() if self._end is not None else []
            ready, _, _ = select.select([self._wake_read, *fds], [], [], self._transmit())
            for fd in ready:
                if fd == self._wake_read:
                    os.read(fd, 4096)
                    self._apply_fault()
                elif self._end is not None:
                    self._receive(self._end, fd)
        self._pull_out()

    def _apply_fault(self) -> None:
        self._fault = self._requested_fault
        if self._fault == UNPLUGGED:
            self._pull_out()
        elif self._end is None:
            self._plug_in()
        self._applied.set()

    def _receive(self, end: End, fd: int) -> None:
        data = end.read(fd)
        reply = self._listener.receive(data)
        if not reply:
            return
        self.replies += 1
        # transmission of the request takes time, too
        start_s = self._clock.monotonic() + len(data) * self._character_s
        if self._fault is not None:
            reply = self._damages[self._fault](reply)
        if self._fault == "late":
            start_s += LATE_TIMEOUTS * self._settings.timeout_s
        if self._replies:  # in order, even behind a late one
            start_s = max(start_s, self._end_s(self._replies[-1]))
        self._replies.append(_Reply(start_s, fd, reply))

    def _transmit(self) -> float | None:
        """Write what is due; returns the time in s until more is due, None if no reply is under way."""
        if self._end is None:
            return None
        now_s = self._clock.monotonic()
        while self._replies:
            reply = self._replies[0]
            if now_s >= self._end_s(reply):
                self._end.write(reply.fd, reply.data[reply.sent :])
                del self._replies[0]
                continue
            if now_s < reply.start_s:
                return min(reply.start_s + PIECE_S, self._end_s(reply)) - now_s
            due = int((now_s - reply.start_s) / self._character_s)
            self._end.write(reply.fd, reply.data[reply.sent : due])
            reply.sent = due
            return min(PIECE_S, self._end_s(reply) - now_s)
        return None

    def _end_s(self, reply: _Reply) -> float:
        return reply.start_s + len(reply.data) * self._character_s
