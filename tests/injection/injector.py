"""The injector: a process between the ports of a simulated machine and the daemon, through which every reply passes.

`Injector` is the test's side. The process itself has one thread, which waits for bytes and for what is due.
"""

from __future__ import annotations

import multiprocessing
import select
import sys
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Self

import yaml

from tests.injection.ends import LOOPBACK, DeviceConnection, DevicePort, End, ListeningEnd, PtyEnd
from tests.injection.faults import Exchange, Fault
from tests.injection.line_faults import FaultOfLine, sent_through
from tests.injection.replies import Protocol, protocol_of

ANSWER_WITHIN_S = 90.0


@dataclass
class _Pending:
    """A request that the device has not yet answered. asker : the line that asked; None if it was unplugged since."""

    asker: str | None
    request: bytes


@dataclass
class _Line:
    """One line: its end to the daemon, its device, and what is on the way."""

    name: str
    protocol: Protocol
    device: End
    end: End | None = None
    requests: bytes = b""
    replies: bytes = b""
    pending: deque[_Pending] = field(default_factory=deque)
    faults: list[FaultOfLine] = field(default_factory=list)
    # (time, data), in order of time
    due: deque[tuple[float, bytes]] = field(default_factory=deque)


class _Wires:
    """The injector's process."""

    def __init__(self, configuration: Mapping[str, Any], directory: Path) -> None:
        """directory : of the daemon's ports."""
        self._directory = directory
        self._lines = {}
        for name, settings in configuration["lines"].items():
            device: End
            if settings["kind"] == "modbus_tcp":
                device = DeviceConnection(settings["host"], settings["port"])
            else:
                device = DevicePort(Path(settings["port"]))
            self._lines[name] = _Line(name, protocol_of(name, configuration), device)
        self._tcp_ports: dict[str, int] = {}
        self._device_of = {name: name for name in self._lines}
        for name in self._lines:
            self.plug(name)

    @property
    def ports(self) -> dict[str, str | int]:
        """By line: a device path, or a TCP port of this computer."""
        return {name: self._tcp_ports.get(name, str(self._directory / name)) for name in self._lines}

    def plug(self, name: str) -> None:
        line = self._lines[name]
        if line.end is not None:
            return
        if isinstance(line.device, DeviceConnection):
            end = ListeningEnd(self._tcp_ports.get(name, 0))
            self._tcp_ports[name] = end.port
            line.end = end
        else:
            line.end = PtyEnd(self._directory / name)

    def unplug(self, name: str) -> None:
        line = self._lines[name]
        if line.end is not None:
            line.end.close()
        line.end = None
        line.requests = b""
        line.due.clear()
        for other in self._lines.values():
            for pending in other.pending:
                pending.asker = None if pending.asker == name else pending.asker

    def replug(self, name: str) -> None:
        self.unplug(name)
        self.plug(name)

    def fault(self, name: str, fault: Fault | None) -> None:
        faults = self._lines[name].faults
        if fault is None:
            faults.clear()
        else:
            faults.append(FaultOfLine(fault, time.monotonic()))

    def connect(self, device_of: Mapping[str, str]) -> None:
        """From now on the daemon's line asks this line's device."""
        self._device_of.update(device_of)

    def repair(self) -> None:
        """Everything as it was at first."""
        for name, line in self._lines.items():
            line.faults.clear()
            self._device_of[name] = name
            self.plug(name)

    def run(self, orders: Connection) -> None:
        """Until the order to stop. An order is the name of a method and its arguments; each is answered."""
        while True:
            owners = {fd: line for line in self._lines.values() if line.end is not None for fd in line.end.fds()}
            devices = {fd: line for line in self._lines.values() for fd in line.device.fds()}
            ready, _, _ = select.select([orders.fileno(), *owners, *devices], [], [], self._write_due())
            now_s = time.monotonic()
            for fd in ready:
                if fd in devices:
                    self._from_device(devices[fd], fd, now_s)
                elif fd in owners:
                    self._from_daemon(owners[fd], fd)
            if orders.fileno() in ready:  # last: it may close ends
                order, *arguments = orders.recv()
                if order == "stop":
                    break
                orders.send(getattr(self, order)(*arguments))
        for name, line in self._lines.items():
            self.unplug(name)
            line.device.close()

    def _from_daemon(self, line: _Line, fd: int) -> None:
        assert line.end is not None
        line.requests += line.end.read(fd)
        device = self._lines[self._device_of[line.name]]
        while length := line.protocol.request_length(line.requests):
            request, line.requests = line.requests[:length], line.requests[length:]
            device.pending.append(_Pending(line.name, request))
            device.device.write(request)

    def _from_device(self, device: _Line, fd: int, now_s: float) -> None:
        device.replies += device.device.read(fd)
        while length := device.protocol.reply_length(device.replies):
            reply, device.replies = device.replies[:length], device.replies[length:]
            if not device.pending:  # of a request from before this process began, or twice: it belongs to none
                print(f"{device.name}: a reply that nobody has asked for: {reply!r}", file=sys.stderr, flush=True)
                continue
            pending = device.pending.popleft()
            if pending.asker is not None:
                self._reply(self._lines[pending.asker], pending.request, reply, now_s)

    def _reply(self, line: _Line, request: bytes, reply: bytes, now_s: float) -> None:
        exchange = Exchange(line.protocol, request, reply)
        for sent in sent_through(line.faults, exchange, now_s):
            pieces = [sent.data] if sent.gap_s == 0.0 else [bytes([byte]) for byte in sent.data]
            for index, piece in enumerate(pieces):
                self._send(line, now_s + sent.delay_s + index * sent.gap_s, piece)

    def _send(self, line: _Line, time_s: float, data: bytes) -> None:
        if line.due:
            time_s = max(time_s, line.due[-1][0])  # nothing overtakes
        line.due.append((time_s, data))

    def _write_due(self) -> float | None:
        """Write what is due; the time until more is, s."""
        now_s = time.monotonic()
        for line in self._lines.values():
            while line.due and line.due[0][0] <= now_s:
                _, data = line.due.popleft()
                if line.end is not None:
                    line.end.write(data)
        nexts = [line.due[0][0] for line in self._lines.values() if line.due]
        return max(0.0, min(nexts) - now_s) if nexts else None


def _serve(configuration: Mapping[str, Any], directory: Path, orders: Connection) -> None:
    wires = _Wires(configuration, directory)
    orders.send(wires.ports)
    wires.run(orders)


class Injector:
    """The test's side: starts the process, writes the daemon's configuration, and orders faults.

    A context manager. Every order is done when its method returns.
    """

    def __init__(self, configuration: Mapping[str, Any], directory: Path) -> None:
        """configuration : the daemon's, with the ports of the simulated machine. directory : for ports, existing."""
        self.configuration = configuration
        self._directory = directory
        context = multiprocessing.get_context("spawn")
        self._orders, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(configuration, directory, theirs), daemon=True)

    def __enter__(self) -> Self:
        self._process.start()
        self.ports: Mapping[str, str | int] = self._receive()
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.is_alive():
            self._orders.send(["stop"])
        self._process.join(ANSWER_WITHIN_S)
        self._orders.close()

    def daemon_configuration(self) -> dict[str, Any]:
        """The configuration with the injector's ports in place of the machine's."""
        data: dict[str, Any] = yaml.safe_load(yaml.safe_dump(self.configuration))
        for name, port in self.ports.items():
            if isinstance(port, str):
                data["lines"][name]["port"] = port
            else:
                data["lines"][name] |= {"host": LOOPBACK, "port": port}
        return data

    def fault(self, line: str, fault: Fault | None) -> None:
        """From the next reply on, beside those that the line has; None ends all of them."""
        self._order("fault", line, fault)

    def unplug(self, *lines: str) -> None:
        """The pty is gone; a TCP connection is reset and nobody listens."""
        for line in lines:
            self._order("unplug", line)

    def plug(self, *lines: str) -> None:
        for line in lines:
            self._order("plug", line)

    def replug(self, *lines: str) -> None:
        """Another pty in its place at once; a TCP connection is reset."""
        for line in lines:
            self._order("replug", line)

    def exchange(self, one: str, other: str) -> None:
        """The daemon's two lines ask each other's device."""
        self._order("connect", {one: other, other: one})

    def repair(self) -> None:
        """No fault, all plugged in, no line exchanged."""
        self._order("repair")

    def _order(self, *order: Any) -> Any:
        self._orders.send(order)
        return self._receive()

    def _receive(self) -> Any:
        assert self._orders.poll(ANSWER_WITHIN_S), "the injector does not answer"
        return self._orders.recv()
