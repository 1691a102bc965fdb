"""Faults of a line: what becomes of each whole reply on its way to the daemon.

A fault is made for a line, sent to the injector, and asked for every reply from then on. It keeps its own state and,
with a seed, its own random numbers, so that a run can be repeated.
"""

from __future__ import annotations

import random
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field

from tests.injection.replies import Protocol, Values


@dataclass(frozen=True)
class Exchange:
    """A request of the daemon and the device's reply to it.

    number : of the replies since the fault began, from 0. elapsed_s : time since then.
    """

    protocol: Protocol
    request: bytes
    reply: bytes
    number: int = 0
    elapsed_s: float = 0.0


@dataclass(frozen=True)
class Sent:
    """Bytes to the daemon, `delay_s` after the reply came, with `gap_s` between any two of them."""

    data: bytes
    delay_s: float = 0.0
    gap_s: float = 0.0


class Fault(ABC):
    """What happens to the replies of a line.

    needs_whole : it reads the numbers of a reply, so that nothing may have damaged it before.
    """

    needs_whole = False

    @abstractmethod
    def send(self, exchange: Exchange) -> list[Sent]:
        """What the daemon gets in place of the reply."""


class NumbersFault(Fault):
    """A fault of the numbers alone: the reply is whole, and its checksum fits."""

    needs_whole = True

    @abstractmethod
    def numbers(self, values: Values, exchange: Exchange) -> Mapping[str, float]:
        """The numbers in place of the reply's own, by channel."""

    def send(self, exchange: Exchange) -> list[Sent]:
        values = exchange.protocol.values(exchange.request, exchange.reply)
        if not values:
            return [Sent(exchange.reply)]
        numbers = {**values, **self.numbers(values, exchange)}
        return [Sent(exchange.protocol.with_values(exchange.request, exchange.reply, numbers))]


# --- replies that are lost, late or damaged ------------------------------------------------------------------------


@dataclass
class Lost(Fault):
    """Replies that never come: the first `count` of them, then each with this probability."""

    count: int = 0
    probability: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def send(self, exchange: Exchange) -> list[Sent]:
        lost = exchange.number < self.count or self._random.random() < self.probability
        return [] if lost else [Sent(exchange.reply)]


@dataclass
class Late(Fault):
    """Replies that come later by `delay_s`: the first `count`, or all."""

    delay_s: float
    count: int | None = None

    def send(self, exchange: Exchange) -> list[Sent]:
        late = self.count is None or exchange.number < self.count
        return [Sent(exchange.reply, delay_s=self.delay_s if late else 0.0)]


@dataclass
class OneReplyLate(Fault):
    """Each request is answered by the reply to the one before it.

    reframed : the old numbers in the frame of the new reply, as of a gateway that keeps a copy: its transaction fits.
    """

    reframed: bool = False
    _before: Exchange | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self.needs_whole = self.reframed

    def send(self, exchange: Exchange) -> list[Sent]:
        before, self._before = self._before, exchange
        if before is None:
            return []
        if not self.reframed:
            return [Sent(before.reply)]
        protocol = exchange.protocol
        old = protocol.values(before.request, before.reply)
        new = protocol.values(exchange.request, exchange.reply)
        return [Sent(protocol.with_values(exchange.request, exchange.reply, {**new, **old}))]


@dataclass
class Garbage(Fault):
    """Random bytes in place of replies."""

    seed: int = 0

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def send(self, exchange: Exchange) -> list[Sent]:
        return [Sent(self._random.randbytes(len(exchange.reply)))]


@dataclass
class FlippedBits(Fault):
    """In every byte, with this probability, `bits` bits are turned."""

    probability: float
    bits: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def send(self, exchange: Exchange) -> list[Sent]:
        data = bytearray(exchange.reply)
        for index in range(len(data)):
            if self._random.random() < self.probability:
                for bit in self._random.sample(range(8), self.bits):
                    data[index] ^= 1 << bit
        return [Sent(bytes(data))]


@dataclass
class Shorter(Fault):
    """The last byte is lost, of the first `count` replies or of all."""

    count: int | None = None

    def send(self, exchange: Exchange) -> list[Sent]:
        short = self.count is None or exchange.number < self.count
        return [Sent(exchange.reply[:-1] if short else exchange.reply)]


@dataclass
class ByteByByte(Fault):
    """One byte at a time."""

    gap_s: float

    def send(self, exchange: Exchange) -> list[Sent]:
        return [Sent(exchange.reply, gap_s=self.gap_s)]


# --- numbers that are wrong ----------------------------------------------------------------------------------------


@dataclass
class Off(NumbersFault):
    """Numbers that are off: by `by`, and by `drift_per_s` more every second, in the first `count` replies or in all."""

    channels: tuple[str, ...]
    by: float = 0.0
    drift_per_s: float = 0.0
    count: int | None = None
    every: int = 1

    def numbers(self, values: Values, exchange: Exchange) -> Mapping[str, float]:
        if exchange.number % self.every or (self.count is not None and exchange.number >= self.count * self.every):
            return {}
        off = self.by + self.drift_per_s * exchange.elapsed_s
        return {name: values[name] + off for name in self.channels if name in values}


@dataclass
class OneDigit(NumbersFault):
    """One digit of a channel is another one, in the first `count` replies.

    place : of the digit, the power of ten in mm: -1 is a tenth.
    """

    channel: str
    place: int
    count: int = 1
    digit: int = 7

    def numbers(self, values: Values, exchange: Exchange) -> Mapping[str, float]:
        if exchange.number >= self.count:
            return {}
        value, weight = values[self.channel], 10.0**self.place
        was = int(abs(value) / weight + 1e-6) % 10
        digit = self.digit if was != self.digit else (was + 1) % 10
        off = (digit - was) * weight
        return {self.channel: value - off if value < 0 else value + off}


@dataclass
class Shows(NumbersFault):
    """Channels that show this number, whatever they measure."""

    channels: tuple[str, ...]
    number: float

    def numbers(self, values: Values, exchange: Exchange) -> Mapping[str, float]:
        return {name: self.number for name in self.channels if name in values}


@dataclass
class Stuck(NumbersFault):
    """Channels that show for ever what they showed first; without names, all of them."""

    channels: tuple[str, ...] = ()
    _first: Values = field(default_factory=dict, init=False)

    def numbers(self, values: Values, exchange: Exchange) -> Mapping[str, float]:
        for name, value in values.items():
            if not self.channels or name in self.channels:
                self._first.setdefault(name, value)
        return {name: self._first[name] for name in values if name in self._first}


@dataclass
class Sticks(NumbersFault):
    """A channel that follows for `way_mm` and stays there."""

    channel: str
    way_mm: float
    _first_mm: float | None = field(default=None, init=False)

    def numbers(self, values: Values, exchange: Exchange) -> Mapping[str, float]:
        if self.channel not in values:
            return {}
        if self._first_mm is None:
            self._first_mm = values[self.channel]
        way_mm = values[self.channel] - self._first_mm
        return {self.channel: self._first_mm + max(-self.way_mm, min(way_mm, self.way_mm))}


@dataclass
class Exchanged(NumbersFault):
    """Two channels of one unit that show each other's number."""

    one: str
    other: str

    def numbers(self, values: Values, exchange: Exchange) -> Mapping[str, float]:
        if not {self.one, self.other} <= values.keys():
            return {}
        return {self.one: values[self.other], self.other: values[self.one]}
