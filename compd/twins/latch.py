"""The latch of the devices on a simulated line: from a round trigger on they show what they sensed when it came."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from compd.twins.device import Sense, SimulatedByteDevice, SimulatedRegisterDevice


class Latch:
    """What the devices of a line have latched. Before the first trigger they show what they sense."""

    def __init__(self, devices: Sequence[SimulatedByteDevice | SimulatedRegisterDevice]) -> None:
        """`devices`: sense by way of the latch from now on."""
        self._latched = [_LatchedSense(device.sense) for device in devices]
        for device, latched in zip(devices, self._latched, strict=True):
            device.sense = latched

    def close(self) -> None:
        """The trigger has come."""
        for sense in self._latched:
            sense.latch()


class _LatchedSense:
    """Of one device. A channel that is asked for the first time is latched then: before it, nobody knows its name."""

    def __init__(self, sense: Sense) -> None:
        self._sense = sense
        self._channels: set[str] = set()
        self._values: dict[str, float] | None = None

    def __call__(self, channel: str) -> float:
        self._channels.add(channel)
        if self._values is None:
            return self._sense(channel)
        if channel not in self._values:
            self._values[channel] = self._sense(channel)
        return self._values[channel]

    def latch(self) -> None:
        self._values = {channel: self._sense(channel) for channel in self._channels}


class _Listener(Protocol):
    def hear(self, data: bytes) -> bytes: ...


class TriggeredDevices:
    """Devices on a line of bytes that a round trigger latches; none of them answers it."""

    def __init__(self, devices: _Listener, trigger: bytes, latch: Latch) -> None:
        """`trigger`: the bytes of the round trigger."""
        self._devices = devices
        self._trigger = trigger
        self._latch = latch
        self._heard = b""

    def hear(self, data: bytes) -> bytes:
        """Receive bytes, in pieces of any size; the replies to complete requests."""
        *before, rest = (self._heard + data).split(self._trigger)
        replies = b""
        for requests in before:
            replies += self._devices.hear(requests)
            self._latch.close()
        begun = next(
            n for n in range(min(len(rest), len(self._trigger) - 1), -1, -1) if rest.endswith(self._trigger[:n])
        )
        end = len(rest) - begun
        self._heard = rest[end:]
        return replies + (self._devices.hear(rest[:end]) if end else b"")
