"""One driver on one wire: polled as the daemon does, every number compared with what the device's sensor had."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from compd.clock import Clock
from compd.commissioning.conformance.faults import Fault
from compd.commissioning.conformance.peer import Peer, SensorValues
from compd.gauge import Gauge, LineFault, Quality, Reading, bad
from compd.live.acquisition.acquisition import NOTHING_UNDER_WAY

LOOKS = 24  # fault-free polls that the tolerance, a gauge's last digit, is taken from
COARSEST = 0.01  # of the range: a difference beyond it is no last digit, but a wrong unit, scale or sign
# A wrong number is further off than this many of the largest difference that was seen without faults.
MARGIN = 2.0
SMALLEST = 1e-9  # of the range: rounding in floating point
MOST_RECOVERING_POLLS = 4
SETTLING_DRAINS = 3  # each waits for a timeout of silence: longer than any reply here is late
# In line timeouts, after a request without an answer: the wait for the reply, then the line is drained for one more.
ASKED_AGAIN_TIMEOUTS = 2.0


class ConformanceWire(Protocol):
    """A wire with a device at its far end: virtual, pty or TCP."""

    peer: Peer
    timeout_s: float

    @property
    def clock(self) -> Clock: ...
    def open(self) -> Any: ...
    def unplug(self) -> None: ...
    def replug(self) -> None: ...
    def close(self) -> None: ...


@dataclass(frozen=True)
class Poll:
    """The readings of one poll. `wrong`: every OK reading that should not be one, in words."""

    readings: Sequence[Reading]
    wrong: tuple[str, ...]

    @property
    def qualities(self) -> frozenset[Quality]:
        return frozenset(reading.quality for reading in self.readings)

    @property
    def ok(self) -> bool:
        return self.qualities == {Quality.OK} and not self.wrong

    def __str__(self) -> str:
        qualities = ", ".join(sorted(self.qualities))
        details = sorted({reading.detail for reading in self.readings if reading.detail})
        return "; ".join([qualities, *self.wrong] if self.wrong else [qualities, *details[:1]])


@dataclass
class ConformanceSession:
    """A driver that polls over `wire`, as a line's thread would: drained after a fault, opened anew when lost,
    at rest after a silence."""

    gauge: Gauge[Any]
    wire: ConformanceWire
    sensors: SensorValues
    tolerance: dict[str, float] = field(default_factory=dict)  # by channel, in its unit
    _line: Any = None

    def poll(self, faults: Iterable[Fault] = (), new_values: bool = True) -> Poll:
        """One poll; `faults`: one for each of its replies, in order; `new_values`: with new values at the sensors."""
        if new_values:
            self.sensors.advance()
        self.wire.peer.set_faults(faults)
        self.sensors.sensed_s = math.nan
        started_s = self.wire.clock.monotonic()
        try:
            readings = self._read()
        finally:
            self.wire.peer.set_faults(())
        return Poll(readings, tuple(self._wrong(readings, started_s)))

    def recover(self) -> tuple[int, Poll]:
        """Poll without faults until all is good: how many polls that took, and the last one."""
        polls = [self.poll()]
        while polls[-1].qualities != {Quality.OK} and len(polls) < MOST_RECOVERING_POLLS:
            polls.append(self.poll())
        return len(polls), Poll(polls[-1].readings, tuple(text for poll in polls for text in poll.wrong))

    def calibrate(self) -> str | None:
        """Set each channel's tolerance from fault-free polls; says what is wrong where the differences are too large.

        tolerance = MARGIN x largest difference + SMALLEST x range; a difference beyond COARSEST x range is an error.
        """
        differences: dict[str, list[float]] = {channel.name: [] for channel in self.gauge.channels}
        extents: dict[str, list[float]] = {channel.name: [] for channel in self.gauge.channels}
        self.tolerance = dict.fromkeys(differences, math.inf)
        for _ in range(LOOKS):
            poll = self.poll()
            if not poll.ok:
                return f"a poll without any fault gave {poll}"
            for channel, reading in zip(self.gauge.channels, poll.readings, strict=True):
                differences[channel.name].append(abs(reading.value - self.sensors.values[channel.name]))
                extents[channel.name].append(self.sensors.values[channel.name])
        for name, off in differences.items():
            extent = max(extents[name]) - min(extents[name])
            largest = max(off)
            if largest > COARSEST * extent:
                return f"channel {name} is off by {largest:.6g} of a range of {extent:.6g}: wrong unit, scale or sign"
            self.tolerance[name] = MARGIN * largest + SMALLEST * extent
        return None

    def settle(self) -> None:
        """Wait until nothing is under way to us any more."""
        if self._line is not None:
            for _ in range(SETTLING_DRAINS):
                self._line.drain()

    def reopen(self) -> None:
        """Close the line; the next poll opens it anew."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def close(self) -> None:
        """Close the line and the wire."""
        if self._line is not None:
            self._line.close()
        self.wire.close()

    def _read(self) -> Sequence[Reading]:
        try:
            if self._line is None:
                self._line = self.wire.open()
            return self.gauge.read(self._line)
        except LineFault as fault:
            now_s = self.wire.clock.monotonic()
            self._after(fault)
            return [bad(now_s, fault.quality, fault.detail)] * len(self.gauge.channels)
        except Exception as error:  # noqa: BLE001  a driver is anybody's code: what it raises is a finding
            self._after(LineFault(Quality.DRIVER_ERROR))
            text = f"raised {type(error).__name__}: {error}"
            return [bad(self.wire.clock.monotonic(), Quality.DRIVER_ERROR, text)] * len(self.gauge.channels)

    def _after(self, fault: LineFault) -> None:
        """As the line's thread does: drain, or close what is lost."""
        if self._line is None:
            return
        try:
            if fault.quality is not Quality.LINE_LOST:
                if fault.quality not in NOTHING_UNDER_WAY:
                    self._line.drain()
                return
        except LineFault:
            pass  # lost while draining: closed like any lost line
        self._line.close()
        self._line = None

    def _wrong(self, readings: Sequence[Reading], started_s: float) -> Iterable[str]:
        channels = self.gauge.channels
        if len(readings) != len(channels):
            yield f"{len(readings)} readings for {len(channels)} channels"
            return
        for channel, reading in zip(channels, readings, strict=True):
            if not reading.ok:
                if not math.isnan(reading.value):
                    yield f"{channel.name}: {reading.quality} with a number, {reading.value!r}"
                continue
            value = self.sensors.values[channel.name]
            if not abs(reading.value - value) <= self.tolerance.get(channel.name, math.inf):
                yield f"{channel.name}: {reading.value:.6g} {channel.unit} as ok, the sensor had {value:.6g}"
            if reading.time_s < started_s:
                yield f"{channel.name}: time stamp {(started_s - reading.time_s) * 1e3:.3f} ms before the poll began"
            # an understated age: stamped after the device had looked
            if reading.time_s > self.sensors.sensed_s + SMALLEST:
                late_ms = (reading.time_s - self.sensors.sensed_s) * 1e3
                yield f"{channel.name}: time stamp {late_ms:.3f} ms after the device had sampled"
