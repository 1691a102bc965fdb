"""Presets that match a device on a serial port: sends each preset's read request, and judges the reply.

Two presets may fit one device. None is announced alone unless it is the only one that fits, and a Modbus slave, which
answers to every map that it has the registers of, is announced as a Modbus slave.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from compd.clock import MonotonicClock
from compd.gauge import Gauge, LineFault, Quality, Reading
from compd.gauge_tools.open_gauge import byte_line_settings, line_settings
from compd.line_settings import powered
from compd.lines import Port, PortArguments, StreamLine, WrappedPorts, explained, open_line, open_stream, shown
from compd.plugins import GAUGES, load, names

PROBE_TIMEOUT_S = 0.5
# Time (s) to listen to a port before probing; a device that sends unsolicited data at 1 Hz or faster is not probed.
LISTEN_S = 1.2
# Silence (s) that ends a device's answer to an empty or unknown command.
QUIET_S = 0.1
# End of a command of a text instrument.
COMMAND_END = b"\r"
_ENDS = re.compile(rb"[\r\n]*$")
# Faults of a line without an answer, or without one in this protocol.
_NO_ANSWER = (Quality.TIMEOUT, Quality.LINE_LOST)


@dataclass(frozen=True)
class PresetCandidate:
    """A preset that can be tried with its sample's options, without further knowledge of the device."""

    name: str
    gauge: Gauge[Any]
    baud: int
    format: str

    @property
    def on_registers(self) -> bool:
        """Whether it is a Modbus slave."""
        return self.gauge.line_kind == "registers"


@dataclass(frozen=True)
class ProbeOutcome:
    """Outcome of one candidate: its readings, or the fault."""

    candidate: PresetCandidate
    readings: Sequence[Reading] = ()
    fault: LineFault | None = None

    @property
    def fits(self) -> bool:
        """Whether the reply fits this preset: existing registers, or a value."""
        return any(reading.ok for reading in self.readings) or (bool(self.readings) and self.candidate.on_registers)

    @property
    def answered(self) -> bool:
        """Whether a device answered at all; for Modbus, with a whole frame."""
        if self.fault is None:
            return True
        if self.candidate.on_registers:
            return self.fault.quality is Quality.DEVICE_ERROR
        return self.fault.quality not in _NO_ANSWER

    def __str__(self) -> str:
        if self.fault is not None:
            return str(self.fault)
        return ", ".join(
            f"{channel.name} {reading.value:.6g} {channel.unit}" if reading.ok else f"{channel.name} {reading.quality}"
            for channel, reading in zip(self.candidate.gauge.channels, self.readings, strict=True)
        )


def preset_candidates() -> list[PresetCandidate]:
    """Presets with stated port settings that need no options besides their sample's."""
    candidates = []
    for name in names(GAUGES):
        driver = load(GAUGES, name, name)
        if driver.usual_line is not None:
            options = driver.Options.model_validate({"driver": name, "line": "probe", **(driver.sample_options or {})})
            candidates.append(PresetCandidate(name, driver(options), *driver.usual_line))
    return candidates


def announcements(path: str, candidates: Sequence[PresetCandidate]) -> Iterator[str]:
    """Answers on the port `path`, a line of text each. SENDS BYTES, unless a device there sends unsolicited data.

    The presets that speak text come first: what is no text may leave an instrument in a state of its own.
    """
    if received := _received(path):
        yield (
            f"a device sends unsolicited data, {shown(received)}: nothing was sent; "
            "`compd gauge learn` with its baud rate"
        )
        return
    outcomes = [probe_port(path, candidate) for candidate in sorted(candidates, key=lambda c: c.on_registers)]
    text = [outcome for outcome in outcomes if outcome.fits and not outcome.candidate.on_registers]
    slave = [outcome for outcome in outcomes if outcome.answered and outcome.candidate.on_registers]
    if len(text) > 1:
        yield f"a device answers; presets that fit: {', '.join(o.candidate.name for o in text)}; read its label"
    yield from (f"{_setting(outcome)}: {outcome}" for outcome in text)
    if slave:
        yield _slave(slave)
    if text or slave:
        return
    others = [outcome for outcome in outcomes if outcome.answered and not outcome.candidate.on_registers]
    yield from (f"answers, but not as {_setting(outcome)}: {outcome}" for outcome in others)
    if not others:
        lost = next((o.fault for o in outcomes if o.fault and o.fault.quality is Quality.LINE_LOST), None)
        yield str(lost) if lost else f"no answer to {', '.join(outcome.candidate.name for outcome in outcomes)}"


def probe_port(path: str, candidate: PresetCandidate) -> ProbeOutcome:
    """The outcome of one read on the port `path`. SENDS the candidate's request, and the ends of commands around it."""
    try:
        settings = line_settings(
            PortArguments(path, candidate.baud, candidate.format, PROBE_TIMEOUT_S), candidate.gauge.line_kind
        )
        closing = not candidate.on_registers
        line = open_line(
            powered(settings, [candidate.gauge]),
            MonotonicClock(),
            WrappedPorts(lambda port: _ClosedCommands(port, closing)),
        )
        try:
            readings = candidate.gauge.read(line)
            if isinstance(line, StreamLine) and (behind := line.drain(QUIET_S)):
                raise LineFault(Quality.MISMATCH, f"bytes behind the reply: {shown(behind)}")
        except LineFault as fault:
            raise explained(fault, line) from fault
        finally:
            line.close()
    except LineFault as fault:
        return ProbeOutcome(candidate, fault=fault)
    return ProbeOutcome(candidate, readings)


class _ClosedCommands:
    """A port on which no command is left open in the device's buffer.

    A text request follows its own end, by which the device ends what another preset's request has left there; closing
    the port ends whatever was sent last.
    """

    def __init__(self, port: Port, before_requests: bool) -> None:
        self.character_s = port.character_s
        self._port = port
        self._before_requests = before_requests
        self._open = False

    def read(self, timeout_s: float) -> bytes:
        return self._port.read(timeout_s)

    def write(self, data: bytes) -> None:
        end = _end(data)
        if self._before_requests and end:
            self._port.write(end)
            self._discard()
        self._port.write(data)
        self._open = not (self._before_requests and end)

    def set_dtr(self, high: bool) -> None:
        self._port.set_dtr(high)

    def set_break(self, on: bool) -> None:
        self._port.set_break(on)

    def close(self) -> None:
        try:
            if self._open:
                self._port.write(COMMAND_END)
                self._discard()
        except LineFault:
            pass  # the port is lost
        finally:
            self._port.close()

    def _discard(self) -> None:
        """Data until the device is quiet, at most for the time of a probe."""
        for _ in range(int(PROBE_TIMEOUT_S / QUIET_S)):
            if not self._port.read(QUIET_S):
                return


def _end(request: bytes) -> bytes:
    match = _ENDS.search(request)
    return match[0] if match else b""


def _received(path: str) -> bytes:
    """Unsolicited data on a port; b"" also if it cannot be opened."""
    settings = byte_line_settings(PortArguments(path, 9600, "8N1", LISTEN_S))
    try:
        line = open_stream(settings, MonotonicClock())
        try:
            line.listen()
            return line.receive(1) + line.drain(QUIET_S)
        finally:
            line.close()
    except LineFault:
        return b""


def _setting(outcome: ProbeOutcome) -> str:
    """A candidate's name, with all assumptions about the device."""
    candidate = outcome.candidate
    assumed = ", ".join(f"{key}={value}" for key, value in (candidate.gauge.sample_options or {}).items())
    return f"{candidate.name} at {candidate.baud} {candidate.format}" + (f", taken as {assumed}" if assumed else "")


def _slave(outcomes: Sequence[ProbeOutcome]) -> str:
    candidate = outcomes[0].candidate
    unit = (candidate.gauge.sample_options or {}).get("unit")
    fitting = [outcome.candidate.name for outcome in outcomes if outcome.fits]
    text = f"a Modbus slave answers at unit {unit}, {candidate.baud} {candidate.format}; "
    if not fitting:
        return f"{text}no preset fits: {outcomes[0]}; its map makes a gauge of the driver `modbus`"
    return f"{text}presets that fit: {', '.join(fitting)}; Modbus does not say which it is: read its label"
