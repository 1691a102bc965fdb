"""A described ASCII gauge on a scripted line."""

from __future__ import annotations

from typing import Any

import pytest

from compd.gauge import LineFault, Quality, Reading
from compd.lines import StreamLine
from compd_drivers.serial_ascii import SerialAscii
from tests.support.wire_rig import InstantClock, ScriptedPort

CHANNEL = {"name": "value", "unit": "mm"}
SHORT = {"driver": "serial_ascii", "line": "line", "out": "?", "out_terminator": r"\r", "in_terminator": r"\r\n"}


def gauge(**options: Any) -> SerialAscii:
    return SerialAscii(SerialAscii.Options.model_validate({**SHORT, "channels": [CHANNEL], **options}))


def line_with(*script: bytes, device: Any = None) -> tuple[StreamLine, ScriptedPort]:
    clock = InstantClock()
    port = ScriptedPort(clock, script, device)
    return StreamLine(port, 0.1, 0.002, clock), port


def poll(device: SerialAscii, reply: bytes) -> list[Reading]:
    line, _ = line_with(device=lambda request: reply)
    return list(device.read(line))


def fault(device: SerialAscii, reply: bytes) -> Quality:
    with pytest.raises(LineFault) as caught:
        poll(device, reply)
    return caught.value.quality
