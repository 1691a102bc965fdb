"""The interface between compd and a driver whose device speaks by itself: it sends values, and nobody asks for them.

The line's thread hands every message to `hear`, which says what the driver's channels read by it. A driver implements
`channels` and `addresses`, and `decode`; `stamp` where the time of measurement stands in the message itself. When a
value was measured is worked out here, from that time or from the message's arrival (`compd.source_time`).
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
    """What one channel reads by a message.

    place : of the channel, in the order of `channels`. window_s : by how much later than `reading.time_s` it may have
    been measured, s. note : what is wrong with the source's clock, though the reading counts.
    """

    place: int
    reading: Reading
    window_s: float = 0.0
    note: str = ""


class PushedLine(Protocol):
    """A line on which devices speak by themselves."""

    def subscribe(self, addresses: Sequence[str]) -> None:
        """Want what these addresses send, from now on. One that is refused sends a message that says so.

        Called again, it asks for those that were refused. Raises LineFault (LINE_LOST) where nobody answers.
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
        self._sent: dict[int, tuple[float, float]] = {}  # by place: the last time of the source, and the value
        self._newest: dict[int, Reading] = {}  # by place, for `read`

    @property
    @abstractmethod
    def addresses(self) -> Sequence[str]:
        """The topic or node of every channel, in their order."""

    @abstractmethod
    def decode(self, place: int, message: Message, time_s: float) -> Reading:
        """What channel number `place` reads by a message with a value. Raises LineFault where that cannot be used."""

    def stamp(self, place: int, message: Message) -> Stamp:
        """When the value was measured, as the source says. Raises LineFault where a time is missing or makes no sense.

        A value without a time that is to have one is not used.
        """
        return Stamp(message.source_utc_s)

    @property
    def period_s(self) -> float | None:
        """The longest time between two values of an address, s, where the configuration says it."""
        return None

    def hear(self, message: Message) -> Sequence[Heard]:
        """What the channels of the message's address read by it; none for a message that came before."""
        return [
            heard
            for index, address in enumerate(self.addresses)
            if address == message.address and (heard := self._heard(index, message)) is not None
        ]

    def read(self, line: PushedLine) -> Sequence[Reading]:
        """The newest readings of all channels: waits for a message, and at first for one of each address.

        The daemon does not use it; `compd gauge read` and `compd gauge watch` do.
        Raises LineFault: TIMEOUT where nothing comes within the line's timeout, LINE_LOST.
        """
        line.subscribe(self.addresses)
        heard_any = False
        while not heard_any or len(self._newest) < len(self.addresses):
            messages = line.messages()
            if not messages:
                break
            for message in messages:
                heard = self.hear(message)
                self._newest.update({each.place: each.reading for each in heard})
                heard_any = heard_any or bool(heard)
        if not heard_any:
            raise LineFault(Quality.TIMEOUT, f"nothing came on {', '.join(sorted(set(self.addresses)))}")
        return [
            self._newest.get(index, bad(-math.inf, Quality.TIMEOUT, f"nothing came on {address}"))
            for index, address in enumerate(self.addresses)
        ]

    def _heard(self, index: int, message: Message) -> Heard | None:
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
