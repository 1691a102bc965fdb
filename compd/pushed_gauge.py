"""The interface between compd and a driver whose device pushes its values without a request.

The line's thread hands every message to `receive`, which returns the readings of the driver's channels. A driver
implements `channels`, `addresses` and `decode`; also `stamp` if the message contains the time of measurement. The time
of a value is derived here, from that time or from the message's arrival (`compd.source_time`).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Protocol

from pydantic import Field

from compd.gauge import Gauge, GaugeOptions, LineFault, Quality, Reading, bad
from compd.source_time import AgeUnknownError, Arrival, OutOfOrderError, SourceTime, TimeFrom


class Message(NamedTuple):
    """One value of one address, or the reason why there is none.

    Attributes
    ----------
    address : the topic or node, as the gauge has named it.
    payload : the bytes of an MQTT message; the value of an OPC UA node as Python has it (float, int, str ...).
    arrival : how and when it came.
    source_utc_s : time that the protocol sent with it, s since 1970, UTC; nan if it sent none.
    quality, detail : OK, or what the protocol says is wrong.
    """

    address: str
    payload: Any
    arrival: Arrival
    source_utc_s: float = math.nan
    quality: Quality = Quality.OK
    detail: str = ""


class Stamp(NamedTuple):
    """A time of the source: s since 1970, UTC, nan for none; and its last digit, s."""

    utc_s: float
    resolution_s: float = 0.0


class Heard(NamedTuple):
    """The reading of one channel by a message.

    channel_index : in the order of `channels`. window_s : largest delay (s) of the measurement after `reading.time_s`.
    note : fault of the source's clock with a valid reading.
    """

    channel_index: int
    reading: Reading
    window_s: float = 0.0
    note: str = ""


class PushedLine(Protocol):
    """A line on which devices speak by themselves."""

    def subscribe(self, addresses: Sequence[str]) -> None:
        """Want what these addresses send, from now on. One that is refused sends a message that says so.

        Called again, it asks for those that were refused. Raises LineFault (LINE_LOST) if nobody answers.
        """
        ...

    def messages(self, timeout_s: float | None = None) -> Sequence[Message]:
        """What has come, in the order of arrival; where nothing has, what comes first within `timeout_s` (s).

        timeout_s : None is the line's own. Raises LineFault (LINE_LOST).
        """
        ...


class PushedGaugeOptions(GaugeOptions):
    """Keys that every gauge on a line that speaks by itself has."""

    time_from: TimeFrom = Field(
        default="source",
        description="when a value was measured. source: by the time that comes with it, of a clock that agrees with "
        "this computer's (NTP, PTP); arrival: by its arrival, for devices whose clock is not set",
    )


class PushedGauge(Gauge[PushedLine]):
    """Base of drivers of devices that speak by themselves.

    Attributes
    ----------
    silence_hint : what may be the reason where an address sends nothing, behind a semicolon.
    """

    Options: ClassVar[type[GaugeOptions]] = PushedGaugeOptions
    silence_hint: ClassVar[str] = ""

    def __init__(self, options: Any) -> None:
        super().__init__(options)
        self._times = [SourceTime(options.time_from, self.period_s) for _ in self.channels]
        self._sent: dict[int, tuple[float, float]] = {}  # by index: the last time of the source, and the value
        self._newest: dict[int, Reading] = {}  # by index, for `read`

    @property
    @abstractmethod
    def addresses(self) -> Sequence[str]:
        """The topic or node of every channel, in their order."""

    @abstractmethod
    def decode(self, index: int, message: Message, time_s: float) -> Reading:
        """The reading of channel number `index` by a message with a value. Raises LineFault for an unusable one."""

    def stamp(self, index: int, message: Message) -> Stamp:
        """When the value was measured, as the source says. Raises LineFault if a time is missing or makes no sense.

        A value without a time that is to have one is not used.
        """
        return Stamp(message.source_utc_s)

    @property
    def period_s(self) -> float | None:
        """The longest time between two values of an address, s, where the configuration says it."""
        return None

    def receive(self, message: Message) -> Sequence[Heard]:
        """What the channels of the message's address read by it; none for a message that came before."""
        return [
            received
            for index, address in enumerate(self.addresses)
            if address == message.address and (received := self._received(index, message)) is not None
        ]

    def read(self, line: PushedLine) -> Sequence[Reading]:
        """The newest readings of all channels: waits for a message, and at first for one of each address.

        The daemon does not use it; `compd gauge read` and `compd gauge watch` do.
        Raises LineFault: TIMEOUT where nothing comes within the line's timeout, LINE_LOST.
        """
        line.subscribe(self.addresses)
        received_any = False
        while not received_any or len(self._newest) < len(self.addresses):
            messages = line.messages()
            if not messages:
                break
            for message in messages:
                received = self.receive(message)
                self._newest.update({each.channel_index: each.reading for each in received})
                received_any = received_any or bool(received)
        if not received_any:
            raise LineFault(Quality.TIMEOUT, f"nothing came on {', '.join(sorted(set(self.addresses)))}")
        return [
            self._newest.get(index, bad(-math.inf, Quality.TIMEOUT, f"nothing came on {address}"))
            for index, address in enumerate(self.addresses)
        ]

    def _received(self, index: int, message: Message) -> Heard | None:
        arrived_s = message.arrival.arrived_s
        if message.quality is not Quality.OK:
            self._sent.pop(index, None)  # the value before it counts again when the source says so
            return Heard(index, bad(arrived_s, message.quality, message.detail))
        try:
            stamp = self.stamp(index, message)
            time = self._times[index].of(message.arrival, stamp.utc_s, stamp.resolution_s)
            reading = self.decode(index, message, time.time_s)
            if self._is_repeated(index, stamp, reading) and not message.arrival.holds:
                return None
        except LineFault as fault:
            return Heard(index, bad(arrived_s, fault.quality, fault.detail))
        except OutOfOrderError as error:
            return Heard(index, bad(arrived_s, Quality.MISMATCH, str(error)))
        except AgeUnknownError as error:
            return Heard(index, bad(arrived_s, Quality.STALE, str(error)))
        return Heard(index, reading, time.window_s, time.note)

    def _is_repeated(self, index: int, stamp: Stamp, reading: Reading) -> bool:
        """Whether this is a second copy of the last value: only a time of the source that counts can show it."""
        if self.options.time_from == "arrival" or math.isnan(stamp.utc_s):
            return False
        sent, self._sent[index] = self._sent.get(index), (stamp.utc_s, reading.value)
        return sent == self._sent[index]
