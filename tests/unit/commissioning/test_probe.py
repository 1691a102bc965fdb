"""Probing ports: devices that keep what they have heard, others than the presets', slaves, and devices that speak."""

from __future__ import annotations

import os
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from compd.clock import MonotonicClock
from compd.gauge import Quality
from compd.gauge_tools import announcements, preset_candidates
from compd.gauge_tools.probe import PresetCandidate, probe_port
from compd.lines import open_stream
from compd.lines.kinds.modbus_rtu.settings import ModbusRtuLine
from compd.lines.kinds.serial.settings import SerialLine
from compd.plugins import GAUGES, SIMULATED_GAUGES, load
from compd.simulation.wires.simulated_line import SimulatedLine
from tests.support.sampled import sampled
from tests.unit.commissioning.gauge_description.test_capture import talker

CANDIDATES = preset_candidates()


@contextmanager
def instrument(end: bytes, answers: dict[bytes, bytes], unknown: bytes = b"") -> Iterator[tuple[str, list[bytes]]]:
    """The port of a device that keeps every byte until `end` comes, and what it took for commands.

    Bytes of 8 bits stay what they are: 7 bits and a parity are not tried on a pty.
    """
    master, slave = os.openpty()
    tty.setraw(slave)
    heard: list[bytes] = []
    ended = threading.Event()

    def serve() -> None:
        waiting = b""
        while True:
            waiting += os.read(master, 64)
            if ended.is_set():
                return
            *commands, waiting = waiting.split(end)
            for command in commands:
                heard.append(command)
                os.write(master, answers.get(command, unknown if command else b""))

    thread = threading.Thread(target=serve)
    thread.start()
    yield os.ttyname(slave), heard
    ended.set()
    os.write(slave, b"x")
    thread.join()
    os.close(master)
    os.close(slave)


DEVICES: dict[str, tuple[bytes, dict[bytes, bytes], bytes, str]] = {
    "sylvac_optors": (b"\r", {b"?": b"+1.250\r"}, b"ERR1\r", "sylvac_optors at 4800 7E2, taken as unit=mm"),
    "tesa_tt80": (b"\r", {b"?": b"+012.500\r\n"}, b"ERR01\r\n", "tesa_tt80 at 4800 7E2, taken as model=TT90, unit=um"),
    "mahr_c1202": (
        b"\r",
        {b"?": b"1 +0012.5 um;2 ERR6;3 -0003.0 um\r"},
        b"",
        "mahr_c1202 at 9600 7E2, taken as features=[1, 3]",
    ),
    "keyence_gt2_dlrs1a": (
        b"\r\n",
        {b"M0": b"M0" + 9 * b",+001.2500" + b"\r\n"},
        b"ER,??,00\r\n",
        "keyence_gt2_dlrs1a at 9600 8N1, taken as heads=9",
    ),
}


@pytest.mark.parametrize("name", sampled(DEVICES, 4))
def test_a_device_is_found_although_it_keeps_what_others_were_asked(name: str) -> None:
    end, answers, unknown, announced = DEVICES[name]
    with instrument(end, answers, unknown) as (port, _):
        (line,) = announcements(port, CANDIDATES)
    assert line.startswith(announced)
    assert "1.25" in line or "0.0125" in line


@pytest.mark.long
def test_nothing_is_left_in_the_buffer_of_a_device() -> None:
    """What a Modbus master has sent is ended too: the next command is heard as it is."""
    with instrument(b"\r", {b"M": b"+1.250\r"}) as (port, heard):
        for candidate in sorted(CANDIDATES, key=lambda candidate: candidate.name):
            probe_port(port, candidate)
        settings = SerialLine(kind="serial", port=port, baud=9600, format="8N1", timeout_s=0.5)
        line = open_stream(settings, MonotonicClock())
        line.send(b"M\r")
        assert line.receive(7) == b"+1.250\r"
        line.close()
    assert heard[-1] == b"M"


def modbus_slave(tmp_path: Path, name: str, **options: Any) -> SimulatedLine:
    validated = load(GAUGES, name, name).Options.model_validate({"driver": name, "line": "x", **options})
    device = load(SIMULATED_GAUGES, name, name)(validated, lambda channel: 0.25)
    settings = ModbusRtuLine(kind="modbus_rtu", port="/x", baud=115200, format="8N1", timeout_s=0.5)
    return SimulatedLine("slave", settings, [device], tmp_path)


@pytest.mark.long
def test_a_modbus_slave_is_no_preset(tmp_path: Path) -> None:
    """Of two presets whose registers it has, none is announced; nor is a value of theirs."""
    channels = [{"name": f"r{k}", "function": 3, "address": k, "type": "int16", "unit": "1"} for k in range(8)]
    line = modbus_slave(tmp_path, "modbus", unit=1, channels=channels)
    try:
        texts = list(announcements(str(line.start()), CANDIDATES))
    finally:
        line.stop()
    assert texts == [
        "a Modbus slave answers at unit 1, 9600 8N1; presets that fit: adam_4017p, r4dcb08; "
        "Modbus does not say which it is: read its label"
    ]


@pytest.mark.long
def test_a_slave_without_the_registers_of_any_preset(tmp_path: Path) -> None:
    channels = [{"name": "a", "function": 4, "address": 100, "type": "int16", "unit": "1"}]
    line = modbus_slave(tmp_path, "modbus", unit=1, channels=channels)
    try:
        (text,) = announcements(str(line.start()), CANDIDATES)
    finally:
        line.stop()
    assert text.startswith("a Modbus slave answers at unit 1, 9600 8N1; no preset fits: device_error")


def test_two_presets_that_fit_are_both_named() -> None:
    """A third maker's gauge, whose reply both forms allow."""
    with instrument(b"\r", {b"?": b"+1.250\r"}) as (port, _):
        sylvac = next(candidate for candidate in CANDIDATES if candidate.name == "sylvac_optors")
        twin = PresetCandidate("twin", sylvac.gauge, sylvac.baud, sylvac.format)
        lines = list(announcements(port, [sylvac, twin]))
    assert lines[0] == "a device answers; presets that fit: sylvac_optors, twin; read its label"
    assert len(lines) == 3


def test_a_device_that_sends_unsolicited_is_left_alone() -> None:
    with talker(0.3, b"\r") as port:
        (line,) = announcements(port, CANDIDATES)
    assert line.startswith("a device sends unsolicited data, b'+000")


def test_silence_and_a_port_that_is_not_there(tmp_path: Path) -> None:
    with instrument(b"\r", {}) as (port, _):
        sylvac = [candidate for candidate in CANDIDATES if candidate.name == "sylvac_optors"]
        assert list(announcements(port, sylvac)) == ["no answer to sylvac_optors"]
    (text,) = announcements(str(tmp_path / "nothing"), sylvac)
    assert text.startswith("line_lost: cannot open")


def test_an_error_reply_is_no_fit() -> None:
    """Every command is unknown to it: it is no gauge of this preset, although the preset knows the error."""
    with instrument(b"\r", {b"?": b"ERR1\r"}) as (port, _):
        sylvac = [candidate for candidate in CANDIDATES if candidate.name == "sylvac_optors"]
        (text,) = announcements(port, sylvac)
    assert text.startswith("answers, but not as sylvac_optors at 4800 7E2, taken as unit=mm, decimals=3: ")
    assert "device_error" in text


def test_bytes_behind_a_reply_are_no_reply_of_this_preset() -> None:
    with instrument(b"\r", {b"?": b"+1.250\rX"}) as (port, _):
        sylvac = next(candidate for candidate in CANDIDATES if candidate.name == "sylvac_optors")
        outcome = probe_port(port, sylvac)
    assert outcome.fault is not None
    assert outcome.fault.quality is Quality.MISMATCH
