"""The latch of the devices on a simulated line: they show the values sensed at the last round trigger."""

from __future__ import annotations

from collections.abc import Sequence

from compd.twins.device import Listener, Sense, SimulatedByteDevice, SimulatedRegisterDevice


class Latch:
    """Latched values of a line's devices. Before the first trigger they show present values."""

    def __init__(self, devices: Sequence[SimulatedByteDevice | SimulatedRegisterDevice]) -> None:
        """`devices`: sense by way of the latch from now on."""
        self._latched = [_LatchedSense(device.sense) for device in devices]
        for device, latched in zip(devices, self._latched, strict=True):
            device.sense = latched

    def close(self) -> None:
        """Note that the trigger has come."""
        for sense in self._latched:
            sense.latch()


class _LatchedSense:
    """The latch of one device. A channel is latched at its first request: its name is unknown before."""

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


class TriggeredDevices:
    """Devices on a line of bytes that a round trigger latches; none of them answers it."""

    def __init__(self, devices: Listener, trigger: bytes, latch: Latch) -> None:
        """`trigger`: the bytes of the round trigger."""
        self._devices = devices
        self._trigger = trigger
        self._latch = latch
        self._received = b""

    def receive(self, data: bytes) -> bytes:
        """Receive bytes, in pieces of any size; the replies to complete requests."""
        *before, rest = (self._received + data).split(self._trigger)
        replies = b""
        for requests in before:
            replies += self._devices.receive(requests)
            self._latch.close()
        begun = next(
            n for n in range(min(len(rest), len(self._trigger) - 1), -1, -1) if rest.endswith(self._trigger[:n])
        )
        end = len(rest) - begun
        self._received = rest[end:]
        return replies + (self._devices.receive(rest[:end]) if end else b"")
