"""One driver on one wire: polled as by the daemon, every number compared with the device's sensor."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from compd.clock import Clock
from compd.conformance.device_replies import DeviceReplies
from compd.conformance.faults import Fault
from compd.conformance.peer import Exchange, Peer, SensorValues
from compd.gauge import Channel, Gauge, LineFault, Quality, Reading, bad
from compd.live.acquisition import NO_REPLY_PENDING

LOOKS = 24  # fault-free polls at the start
DIGITS_FROM = 2  # number of the first of them for learning the device's digit
STAMP_ROUNDING_S = 1e-9
MAX_RECOVERING_POLLS = 4
SETTLING_DRAINS = 3  # each waits for a timeout of silence, longer than any reply here is late
# Time after a request without an answer, in line timeouts: the wait for the reply, and one for draining.
ASKED_AGAIN_TIMEOUTS = 2.0


class ConformanceWire(Protocol):
    """A wire with a device at its far end: virtual, pty or TCP.

    exact : in virtual time. pause_s : time between two unsolicited lines, s; 0 for a device that is polled.
    """

    peer: Peer
    timeout_s: float
    exact: bool
    pause_s: float
    character_s: float

    @property
    def clock(self) -> Clock: ...
    def open(self) -> Any: ...
    def unplug(self) -> None: ...
    def replug(self) -> None: ...
    def close(self) -> None: ...


@dataclass(frozen=True)
class Poll:
    """The readings of one poll.

    wrong : every OK reading that should not be one, in words.
    undetectable : wrong numbers that the device would itself have sent in these bytes, in words.
    duration_s : on the wire's clock.
    """

    readings: Sequence[Reading]
    wrong: tuple[str, ...]
    undetectable: tuple[str, ...] = ()
    duration_s: float = 0.0

    @property
    def qualities(self) -> frozenset[Quality]:
        return frozenset(reading.quality for reading in self.readings)

    @property
    def ok(self) -> bool:
        return self.qualities == {Quality.OK} and not self.wrong and not self.undetectable

    def __str__(self) -> str:
        qualities = ", ".join(sorted(self.qualities))
        details = sorted({reading.detail for reading in self.readings if reading.detail})
        return "; ".join([qualities, *(self.wrong or self.undetectable or details[:1])])


@dataclass
class ConformanceSession:
    """A driver polled over `wire` as by a line's thread: drains after faults, reopens if lost, rests after silence."""

    gauge: Gauge[Any]
    wire: ConformanceWire
    sensors: SensorValues
    most_requests: int = 0  # lengths in a poll without faults
    _line: Any = None
    replies: DeviceReplies = field(init=False)

    def __post_init__(self) -> None:
        self.replies = DeviceReplies(self.wire.peer, self.sensors)

    @property
    def exchanges(self) -> Sequence[Exchange]:
        """Exchanges of the last poll."""
        return self.wire.peer.exchanges

    def poll(self, faults: Iterable[Fault] = (), new_values: bool = True) -> Poll:
        """One poll; `faults`: one for each of its replies, in order; `new_values`: with new values at the sensors."""
        if new_values:
            self.sensors.advance()
        faults = tuple(faults)
        self.wire.peer.begin_poll(faults)
        self.sensors.sensed_s.clear()
        started_s = self.wire.clock.monotonic()
        readings, fault = self._read()
        duration_s = self.wire.clock.monotonic() - started_s
        wrong, undetectable = self._judge(readings, started_s)
        poll = Poll(readings, tuple(wrong), tuple(undetectable), duration_s)
        if fault is not None:
            self._after(fault)
        elif poll.ok and not faults:
            self.replies.learn(self.exchanges)
            self.most_requests = max(self.most_requests, len(self.exchanges))
        return poll

    def recover(self) -> tuple[int, Poll]:
        """Poll without faults until all is good; return the number of polls and the last one."""
        polls = [self.poll()]
        while polls[-1].qualities != {Quality.OK} and len(polls) < MAX_RECOVERING_POLLS:
            polls.append(self.poll())
        last = polls[-1]
        wrong = tuple(text for poll in polls for text in poll.wrong + poll.undetectable)
        return len(polls), Poll(last.readings, wrong, (), last.duration_s)

    def calibrate(self) -> str | None:
        """Learn the device's digit from fault-free polls; return their violations."""
        names = [channel.name for channel in self.gauge.channels]
        if len(set(names)) != len(names):
            return f"channels named twice: {', '.join(sorted({name for name in names if names.count(name) > 1}))}"
        for look in range(LOOKS):
            poll = self.poll()
            if not poll.ok:
                return f"a poll without any fault gave {poll}"
            if self.replies.at(self.exchanges) != self.replies.at(self.exchanges):
                return "the simulated device answers the same request differently while its sensors stand still"
            if [channel.name for channel in self.gauge.channels] != names:
                return f"`channels` were {', '.join(names)}, and are others after {look + 1} polls"
            if look < DIGITS_FROM:
                for name in names:
                    self.replies.interval(name, self.exchanges)
        for name, (lowest, highest) in self.sensors.extents.items():
            self.replies.digit.setdefault(name, highest - lowest)  # a switch: half of its range is its digit
        return None

    def settle(self) -> None:
        """Wait until no data is in transit to the product."""
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

    def _read(self) -> tuple[Sequence[Reading], LineFault | None]:
        """The readings, or the fault of the whole poll."""
        try:
            if self._line is None:
                self._line = self.wire.open()
            readings = list(self.gauge.read(self._line))
            if not all(isinstance(reading, Reading) for reading in readings):
                raise TypeError("`read` returned something else than readings")
            return readings, None
        except LineFault as caught:
            fault = caught
        except Exception as error:  # noqa: BLE001  foreign code: any exception of a driver is a finding
            fault = LineFault(Quality.DRIVER_ERROR, f"raised {type(error).__name__}: {error}")
        nothing = bad(self.wire.clock.monotonic(), fault.quality, fault.detail)
        return [nothing] * len(self.gauge.channels), fault

    def _after(self, fault: LineFault) -> None:
        """Drain, or close a lost line, as the line's thread does."""
        if self._line is None:
            return
        try:
            if fault.quality is not Quality.LINE_LOST:
                if fault.quality not in NO_REPLY_PENDING:
                    self._line.drain()
                return
        except LineFault:
            pass  # lost while draining: closed like any lost line
        self._line.close()
        self._line = None

    def _judge(self, readings: Sequence[Reading], started_s: float) -> tuple[list[str], list[str]]:
        """Every wrong OK reading: faults of the driver, and undetectable ones."""
        channels = self.gauge.channels
        if len(readings) != len(channels):
            return [f"{len(readings)} readings for {len(channels)} channels"], []
        wrong, off = [], []
        numbers = {c.name: r.value for c, r in zip(channels, readings, strict=True) if r.ok}
        right = self.replies.are_right(numbers, self.exchanges)
        for channel, reading in zip(channels, readings, strict=True):
            if not reading.ok:
                if not math.isnan(reading.value):
                    wrong.append(f"{channel.name}: {reading.quality} with a number, {reading.value!r}")
                continue
            if not isinstance(reading.value, int | float) or not math.isfinite(reading.value):
                wrong.append(f"{channel.name}: {reading.value!r} as ok is no number")
                continue
            if not self.exchanges:
                event = "sent in this poll" if self.wire.pause_s else "asked"
                wrong.append(f"{channel.name}: {reading.value:.9g} {channel.unit} as ok, and nothing was {event}")
                continue
            if not right and not self.replies.is_right(channel.name, reading.value, self.exchanges):
                off.append(self._difference(channel, reading))
            wrong += self._stamp(channel, reading, started_s)
        if not off:
            return wrong, []
        if not wrong and self.exchanges and self.replies.could_be(numbers, self.exchanges):
            return wrong, off
        return off + wrong, []

    def _difference(self, channel: Channel, reading: Reading) -> str:
        value = self.sensors.values[channel.name]
        text = f"{channel.name}: {reading.value:.9g} {channel.unit} as ok, the sensor had {value:.9g}"
        digit = self.replies.digit.get(channel.name)
        if digit and math.isfinite(value):
            digits = abs(reading.value - value) / digit
            text += f", {digits:.3g} of the device's digits ({digit:.2g} {channel.unit}) away"
        return text

    def _stamp(self, channel: Channel, reading: Reading, started_s: float) -> Iterable[str]:
        """Faults of a time stamp: it must follow its request, or the start of the previous unsolicited line."""
        earliest_s, event = started_s, "the request of this poll had left"
        if self.wire.exact and self.exchanges:
            earliest_s = self.exchanges[0].received_s - STAMP_ROUNDING_S
        if self.wire.pause_s:
            earliest_s -= self.wire.pause_s + self.wire.peer.longest * self.wire.character_s
            event = "the line before had begun"
        if reading.time_s < earliest_s:
            early_ms = (earliest_s - reading.time_s) * 1e3
            yield f"{channel.name}: time stamp {early_ms:.3f} ms before {event}"
        # an understated age: stamped after the device had sampled
        sensed_s = self.sensors.sensed_s.get(channel.name, math.nan)
        if reading.time_s > sensed_s + STAMP_ROUNDING_S:
            late_ms = (reading.time_s - sensed_s) * 1e3
            yield f"{channel.name}: time stamp {late_ms:.3f} ms after the device had sampled"
