"""Simulated devices on a line of bytes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from compd.twins.device import Listener, SimulatedByteDevice
from compd.twins.latch import Latch, TriggeredDevices


class ByteDevices:
    """Devices on a line of bytes: each receives everything."""

    def __init__(self, devices: Sequence[SimulatedByteDevice]) -> None:
        self._devices = devices

    def receive(self, data: bytes) -> bytes:
        return b"".join(device.receive(data) for device in self._devices)


def byte_listener(settings: Any, devices: Sequence[SimulatedByteDevice]) -> Listener:
    """The devices, latched by the bytes of `settings.round_trigger` where that is not None."""
    if settings.round_trigger is None:
        return ByteDevices(devices)
    latch = Latch(devices)
    return TriggeredDevices(ByteDevices(devices), settings.round_trigger.request, latch)
