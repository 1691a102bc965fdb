"""A gauge by its driver's name, its line with every byte shown, and polling as by the daemon."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from compd.clock import Clock
from compd.documents import assigned, separate_errors
from compd.errors import ConfigurationError, Problem
from compd.gauge import Gauge, LineFault, LineKind, Quality, Reading, bad
from compd.line_settings import LineSettings, PolledLineSettings, PushedLineSettings, powered
from compd.lines import (
    Line,
    LineDefinition,
    Port,
    PortArguments,
    StreamLine,
    WrappedPorts,
    explained,
    kinds_that_carry,
    open_line,
    open_stream,
)
from compd.live.acquisition import read_latched
from compd.plugins import GAUGES, load
from compd.pushed_gauge import Message, PushedLine

# Where nothing says how old a reading may be: one that is older is no measurement of now.
STALE_AFTER_S = 10.0


@dataclass(frozen=True)
class GaugeTarget:
    """One gauge and its line. stale_after_s : age (s) from which its readings are not used."""

    name: str
    gauge: Gauge[Any]
    line: LineSettings
    stale_after_s: float = STALE_AFTER_S


def gauge_of_driver(driver: str, port: PortArguments, assignments: Sequence[str]) -> GaugeTarget:
    """A gauge without a configuration: its driver's name, a port, and options as KEY=VALUE (VALUE in YAML).

    Raises ConfigurationError for an assignment that is none, and for options that the driver refuses.
    """
    kind = load(GAUGES, driver, f"driver {driver}")
    options = {"driver": driver, "line": "command_line", **assigned("--set", assignments, "heads=9")}
    try:
        gauge = kind(kind.Options.model_validate(options))
    except ValidationError as error:
        raise ConfigurationError(
            [
                Problem(
                    f"--set {'.'.join(map(str, detail['loc']))}",
                    detail["msg"],
                    next_step="`--set KEY=VALUE` for each option that the driver needs",
                )
                for detail in separate_errors(error)
            ]
        ) from error
    line = powered(line_settings(port, kind.line_kind), [gauge])
    return GaugeTarget(driver, gauge, line, gauge.options.stale_after_s or STALE_AFTER_S)


def option_doubts(target: GaugeTarget) -> list[Problem]:
    """What is probably a slip among the gauge's options: a channel without a range, an odd factor."""
    return [
        Problem(".".join(map(str, (target.name, *location))), what, value=value, next_step=next_step)
        for location, what, value, next_step in target.gauge.doubts()
    ]


def line_settings(port: PortArguments, carries: LineKind) -> LineSettings:
    """Settings of a line that carries bytes, registers, nodes or topics.

    Its kind is the one that `port.keys` name; without that the one that claims the port, as TCP does host:port, and
    else the first of those that carry this: a serial port or pyserial URL, with baud rate and format.
    Raises ConfigurationError where a key is missing or not allowed.
    """
    kinds = kinds_that_carry(carries)
    named = {f"kind={kind.kind}": kind for kind in kinds}
    chosen = next((named[key] for key in port.keys if key in named), None)
    return _settings(port, chosen or next((kind for kind in kinds if kind.claims(port.port)), kinds[0]))


def byte_line_settings(port: PortArguments) -> PolledLineSettings:
    """Settings of a line of bytes, as `line_settings` makes them."""
    settings = line_settings(port, "bytes")
    assert isinstance(settings, PolledLineSettings)
    return settings


def _settings(port: PortArguments, kind: LineDefinition) -> LineSettings:
    keys = {
        "kind": kind.kind,
        **kind.port_keys(port),
        "timeout_s": port.timeout_s,
        **assigned("--line", port.keys, kind.example_key),
    }
    try:
        return kind.settings.model_validate(keys)
    except ValidationError as error:
        raise ConfigurationError(
            [
                Problem(
                    f"--{'.'.join(map(str, detail['loc'])) or 'line'}",
                    detail["msg"],
                    value=str(detail["input"]) if detail["loc"] else "",
                )
                for detail in separate_errors(error)
            ]
        ) from error


# Called with ">" and the sent bytes, "<" and the received bytes.
ByteListener = Callable[[str, bytes], None]


class TappedPort:
    """A port that shows every byte to a listener."""

    def __init__(self, port: Port, listener: ByteListener) -> None:
        self.character_s = port.character_s
        self._port = port
        self._listener = listener

    def read(self, timeout_s: float) -> bytes:
        data = self._port.read(timeout_s)
        if data:
            self._listener("<", data)
        return data

    def write(self, data: bytes) -> None:
        self._listener(">", data)
        self._port.write(data)

    def set_dtr(self, high: bool) -> None:
        self._port.set_dtr(high)

    def set_break(self, on: bool) -> None:
        self._port.set_break(on)

    def close(self) -> None:
        self._port.close()


class TappedPushedLine:
    """A line with pushed messages, each shown to a listener."""

    def __init__(self, line: PushedLine, listener: ByteListener) -> None:
        self._line = line
        self._listener = listener

    def subscribe(self, addresses: Sequence[str]) -> None:
        self._line.subscribe(addresses)

    def messages(self, timeout_s: float | None = None) -> Sequence[Message]:
        messages = self._line.messages(timeout_s)
        for message in messages:
            sent = message.payload if isinstance(message.payload, bytes) else str(message.payload).encode()
            self._listener("<", message.address.encode() + b" " + sent)
        return messages


def open_tapped_line(settings: LineSettings, clock: Clock, listener: ByteListener) -> Line:
    """The line as the daemon opens it, with its bytes shown, but for ports that are within a library."""
    return open_line(settings, clock, WrappedPorts(lambda port: TappedPort(port, listener)))


def open_tapped_stream(settings: PolledLineSettings, clock: Clock, listener: ByteListener) -> StreamLine:
    """The byte stream of a line, with its bytes shown, whatever protocol runs over it."""
    return open_stream(settings, clock, WrappedPorts(lambda port: TappedPort(port, listener)))


def read_gauge(target: GaugeTarget, clock: Clock, listener: ByteListener) -> Sequence[Reading]:
    """One poll on a line opened for it and closed again, with its bytes shown. Raises LineFault."""
    line: Any = open_tapped_line(target.line, clock, listener)
    try:
        if isinstance(target.line, PushedLineSettings):
            return target.gauge.read(TappedPushedLine(line, listener))
        return read_latched(target.gauge, line, target.line.round_trigger)
    except LineFault as fault:
        raise explained(fault, line) from fault
    finally:
        line.close()


def aged(reading: Reading, now_s: float, stale_after_s: float) -> Reading:
    """The reading as for the daemon at the monotonic time `now_s` (s); a stale one loses its value."""
    age_s = now_s - reading.time_s
    if not reading.ok or age_s <= stale_after_s:
        return reading
    detail = f"{reading.value:.6f} was measured {_age_text(age_s)} ago; a reading counts for {stale_after_s:g} s"
    return bad(reading.time_s, Quality.STALE, detail)


def _age_text(age_s: float) -> str:
    for unit, seconds in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if age_s >= 2 * seconds:
            return f"{age_s / seconds:.3g} {unit}"
    return f"{age_s:.3g} s"


def poll_gauge(target: GaugeTarget, clock: Clock, polls: int | None) -> Iterator[Sequence[Reading]]:
    """The readings of `polls` polls, or endlessly, made as by a line's thread of the daemon.

    After a fault the line is drained, after a loss it is opened anew; every channel then has the fault's quality.
    """
    line: Line | None = None
    never = threading.Event()
    count = 0
    try:
        while polls is None or count < polls:
            count += 1
            try:
                if line is None:
                    line = open_line(target.line, clock)
                yield read_latched(target.gauge, line, target.line.round_trigger)
            except LineFault as raised:
                fault = raised if line is None else explained(raised, line)
                yield [bad(clock.monotonic(), fault.quality, fault.detail)] * len(target.gauge.channels)
                line = _line_after_fault(line, fault)
                if line is None:
                    clock.wait(never, target.line.back_off_s[0])
    finally:
        if line is not None:
            line.close()


def _line_after_fault(line: Line | None, fault: LineFault) -> Line | None:
    """The drained line; None if it is lost."""
    if line is None:
        return None
    if fault.quality is not Quality.LINE_LOST:
        try:
            line.drain()
        except LineFault:
            pass  # lost meanwhile
        else:
            return line
    line.close()
    return None
