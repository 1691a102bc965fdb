"""Simulated devices on a line of bytes."""

from __future__ import annotations

from collections.abc import Sequence

from compd.line_settings import PolledLineSettings, TriggerBytes
from compd.twins.device import SimulatedByteDevice
from compd.twins.latch import Latch, TriggeredDevices
from compd.twins.polled_twin import Listener


class ByteDevices:
    """Devices on a line of bytes: each receives everything."""

    def __init__(self, devices: Sequence[SimulatedByteDevice]) -> None:
        self._devices = devices

    def receive(self, data: bytes) -> bytes:
        return b"".join(device.receive(data) for device in self._devices)


def byte_listener(settings: PolledLineSettings, devices: Sequence[SimulatedByteDevice]) -> Listener:
    """The devices, latched by the line's round trigger where it has one."""
    if not isinstance(settings.round_trigger, TriggerBytes):
        return ByteDevices(devices)
    latch = Latch(devices)
    return TriggeredDevices(ByteDevices(devices), settings.round_trigger.request, latch)
