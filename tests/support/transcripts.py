"""Transcripts of a gauge's wire: reading one (tests/transcripts/README.md), and replaying it to driver and device."""

from __future__ import annotations

import ast
import socket
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import yaml

from compd.clock import MonotonicClock
from compd.gauge import Gauge, LineFault, Quality, Reading
from compd.lines import RtuMaster
from compd.lines.kinds.modbus_tcp.master import ModbusTcp
from compd.plugins import GAUGES, SIMULATED_GAUGES, load
from compd.twins import ModbusSlaves
from tests.support.patience import PATIENCE_S


@dataclass
class Exchange:
    """One request and its reply; `simulated`: the simulated device answers exactly so."""

    sent: bytes
    received: bytes = b""
    simulated: bool = False


@dataclass
class Poll:
    """What one poll exchanges and gives."""

    line: int
    exchanges: list[Exchange] = field(default_factory=list)
    drained: bytes = b""
    readings: list[str] = field(default_factory=list)
    fault: str = ""


@dataclass
class Transcript:
    """One file."""

    driver: str
    options: dict[str, Any]
    polls: list[Poll]
    over_tcp: bool


PULSE = b"a pulse of DTR"


def octets(text: str) -> bytes:
    """Quoted text or hexadecimal bytes; `dtr` for a request by DTR."""
    if text == "dtr":
        return PULSE
    if text.startswith('"'):
        return ast.literal_eval("b" + text)
    return bytes.fromhex(text)


def parse(path: Path) -> Transcript:
    """A transcript; ValueError names the line that is none."""
    options: dict[str, Any] = {}
    over_tcp = False
    polls: list[Poll] = []
    ended = True
    for number, raw in enumerate(path.read_text(encoding="ascii").splitlines(), start=1):
        mark, _, rest = raw.partition(" ")
        if not raw.strip() or mark == "#":
            continue
        if mark == "options":
            options = yaml.safe_load(rest)
            continue
        if mark == "line":
            over_tcp = rest == "modbus_tcp"
            continue
        if mark == ">" and ended:
            polls.append(Poll(number))
        ended = mark in {"=", "!"}
        poll = polls[-1]
        match mark:
            case ">":
                poll.exchanges.append(Exchange(octets(rest)))
            case "<" | "<*":
                poll.exchanges[-1].received += octets(rest)
                poll.exchanges[-1].simulated = mark == "<*"
            case "~":
                poll.drained = octets(rest)
            case "=":
                poll.readings.append(rest)
            case "!":
                poll.fault = rest
            case _:
                raise ValueError(f"{path.name}:{number}: {raw}")
    return Transcript(path.name.split(".")[0], options, polls, over_tcp)


class ReplayedLine:
    """A line that carries exactly one poll's bytes at a time."""

    unexpected_bytes = 0

    def __init__(self) -> None:
        self._coming: deque[Exchange] = deque()
        self._waiting = b""
        self._time_s = 100.0

    @property
    def received(self) -> bytes:
        return self._waiting

    def begin(self, poll: Poll) -> None:
        assert not self._waiting, f"left over before line {poll.line}: {self._waiting!r}"
        self._coming = deque(poll.exchanges)

    def end(self) -> None:
        assert not self._coming, f"never asked: {self._coming[0].sent!r}"
        assert not self._waiting, f"never read: {self._waiting!r}"

    def send(self, request: bytes) -> float:
        assert not self._waiting, f"{self._waiting!r} was not read before {request!r} was sent"
        assert self._coming, f"{request!r} is not in the transcript"
        expected = self._coming.popleft()
        assert request == expected.sent
        self._waiting = expected.received
        self._time_s += 0.01
        return self._time_s

    def pulse_dtr(self, low_s: float) -> float:
        assert low_s > 0
        return self.send(PULSE)

    def listen(self) -> float:
        raise AssertionError("a transcript is of a device that is asked")

    def receive(self, count: int, timeout_s: float | None = None) -> bytes:
        self._check()
        if len(self._waiting) < count:
            raise LineFault(Quality.INCOMPLETE, f"only {self._waiting!r}")
        return self._take(count)

    def receive_head(self, count: int) -> bytes:
        return self.receive(count)

    def receive_rest(self, head: bytes, count: int) -> bytes:
        if len(self._waiting) < count:
            raise LineFault(Quality.INCOMPLETE, f"only {head + self._waiting!r}")
        return self._take(count)

    def receive_until(self, terminator: bytes, limit: int, timeout_s: float | None = None) -> bytes:
        self._check()
        index = self._waiting.find(terminator)
        if 0 <= index <= limit - len(terminator):
            return self._take(index + len(terminator))
        raise LineFault(Quality.MISMATCH if len(self._waiting) >= limit else Quality.INCOMPLETE, repr(self._waiting))

    def drain(self, quiet_s: float | None = None) -> bytes:
        return self._take(len(self._waiting))

    def close(self) -> None:
        """Nothing to close."""

    def _check(self) -> None:
        if not self._waiting:
            raise LineFault(Quality.TIMEOUT, "silence")

    def _take(self, count: int) -> bytes:
        taken, self._waiting = self._waiting[:count], self._waiting[count:]
        return taken


class ReplayedServer:
    """The far end of a Modbus TCP connection: hears exactly the transcript's bytes, or the connection ends."""

    def __init__(self, exchanges: Sequence[Exchange]) -> None:
        self.wrong: list[str] = []
        self._exchanges = exchanges
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        with self._listener, self._listener.accept()[0] as connection:
            connection.settimeout(PATIENCE_S)
            for exchange in self._exchanges:
                heard = b""
                while len(heard) < len(exchange.sent) and (data := connection.recv(len(exchange.sent) - len(heard))):
                    heard += data
                if heard != exchange.sent:
                    self.wrong.append(f"sent {heard.hex(' ')}, transcript has {exchange.sent.hex(' ')}")
                    return
                connection.sendall(exchange.received)
            if more := connection.recv(1):
                self.wrong.append(f"sent {more!r}... after the transcript's end")

    def join(self) -> None:
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive(), "the driver asked less than the transcript has"


def gauge_of(transcript: Transcript) -> tuple[Gauge[Any], Any]:
    driver = load(GAUGES, transcript.driver, transcript.driver)
    options = driver.Options.model_validate({"driver": transcript.driver, "line": "line", **transcript.options})
    return driver(options), options


def check(reading: Reading, expected: str, unit: str) -> None:
    if expected in set(Quality):
        assert reading.quality == expected, reading
        assert reading.value != reading.value, "no value without quality ok"
        return
    value, expected_unit = expected.split()
    assert reading.ok, reading
    assert reading.value == pytest.approx(float(value), rel=1e-12, abs=1e-15)
    assert unit == expected_unit


def replay(gauge: Gauge[Any], line: Any, polls: Sequence[Poll], begin: Callable[[Poll], None]) -> None:
    for poll in polls:
        begin(poll)
        if poll.fault:
            with pytest.raises(LineFault) as caught:
                gauge.read(line)
            assert caught.value.quality == poll.fault, f"line {poll.line}: {caught.value}"
            drained = line.drain()
            assert drained == poll.drained, f"line {poll.line}: {drained!r} is left on the line, not {poll.drained!r}"
            continue
        readings = gauge.read(line)
        assert len(readings) == len(poll.readings) == len(gauge.channels), f"line {poll.line}"
        for reading, expected, channel in zip(readings, poll.readings, gauge.channels, strict=True):
            check(reading, expected, channel.unit)


@contextmanager
def tcp_line(transcript: Transcript) -> Iterator[ModbusTcp]:
    server = ReplayedServer([exchange for poll in transcript.polls for exchange in poll.exchanges])
    line = ModbusTcp("127.0.0.1", server.port, PATIENCE_S, MonotonicClock())
    try:
        yield line
    finally:
        line.close()
        server.join()
        assert not server.wrong


def replay_transcript(path: Path) -> None:
    """Fails unless the driver sends exactly these bytes, reads all replies and makes of them what the file says."""
    transcript = parse(path)
    gauge, _ = gauge_of(transcript)
    if transcript.over_tcp:
        with tcp_line(transcript) as tcp:
            replay(gauge, tcp, transcript.polls, lambda poll: None)
        return
    wire = ReplayedLine()
    line = RtuMaster(wire, ask_one_more=False) if gauge.line_kind == "registers" else wire  # type: ignore[arg-type]

    def begin(poll: Poll) -> None:
        if poll is not transcript.polls[0]:
            wire.end()
        wire.begin(poll)

    replay(gauge, line, transcript.polls, begin)
    wire.end()


def check_simulated_device(path: Path) -> None:
    """Fails unless the simulated device gives the replies marked <* when its sensors see what the poll gives."""
    transcript = parse(path)
    gauge, options = gauge_of(transcript)
    compared = 0
    for poll in transcript.polls:
        marked = [exchange for exchange in poll.exchanges if exchange.simulated]
        if not marked:
            continue
        values = {
            channel.name: float("nan") if text in set(Quality) else float(text.split()[0])
            for channel, text in zip(gauge.channels, poll.readings, strict=True)
        }
        device = load(SIMULATED_GAUGES, transcript.driver, path.name)(
            options, lambda name, values=values: values.get(name, float("nan"))
        )
        if gauge.line_kind == "registers":
            device = ModbusSlaves([device], over_tcp=transcript.over_tcp)
        for exchange in marked:
            reply = device.speak() if exchange.sent == PULSE else device.receive(exchange.sent)
            assert reply == exchange.received, f"line {poll.line}"
            compared += 1
    assert compared, "mark with <* what the simulated device answers"
