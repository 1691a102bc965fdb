"""Plausibility check of one gauge: when to poll again, what to publish."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

from compd.clock import Clock
from compd.gauge import Quality, Reading
from compd.live.acquisition.possible_motion import WINDOW_S, GaugeSample
from compd.live.acquisition.quantity_trust import QuantityTrust
from compd.live.acquisition.reading_trust import ReadingTrust

# The judge of a length, and that of any other quantity.
Judge: TypeAlias = ReadingTrust | QuantityTrust


class GaugeTrust:
    """Judges the readings of one gauge, channel by channel; used by its line's thread."""

    def __init__(self, channels: Sequence[Judge | None], clock: Clock) -> None:
        """`channels`: the judge of each channel, in their order; None for one that is not wired."""
        self._channels = tuple(channels)
        self._clock = clock
        self._first: Sequence[Reading | None] = ()
        self._shortest_s = math.inf
        self._window_s = 0.0
        self._surprising: dict[int, Reading] = {}  # waiting unsolicited readings, by index of the channel

    def read(self, ask: Callable[[], Sequence[Reading]]) -> Sequence[Reading]:
        """The readings of one poll by `ask`, or of a second poll if a value is outside its predicted range.

        They are not judged yet. Raises what `ask` raises.
        """
        self._first = ()
        readings, self._window_s = self._asked(ask)
        if len(readings) == len(self._channels) and any(map(self._surprises, self._channels, readings)):
            self._first = [reading if reading.ok else None for reading in readings]
            readings, window_s = self._asked(ask)
            self._window_s = max(self._window_s, window_s)
        return readings

    def _asked(self, ask: Callable[[], Sequence[Reading]]) -> tuple[Sequence[Reading], float]:
        """Readings, and the duration (s) of their poll beyond that of the shortest one.

        So late the device may have sampled: it does so at the same time after each request, but for delays on the way.
        """
        start_s = self._clock.monotonic()
        readings = ask()
        duration_s = self._clock.monotonic() - start_s
        self._shortest_s = min(self._shortest_s, duration_s)
        return readings, duration_s - self._shortest_s + WINDOW_S

    def judge(self, readings: Sequence[Reading], now_s: float) -> list[Reading]:
        """The readings of the last poll that may be published, one per channel."""
        firsts = self._first or [None] * len(readings)
        for channel, reading in zip(self._channels, readings, strict=True):
            if channel is not None and reading.ok:
                channel.show(reading)  # a channel that was away is compared with all of its poll, whatever their order
        judged = []
        for channel, reading, first in zip(self._channels, readings, firsts, strict=True):
            if channel is not None and reading.ok:
                judged.append(channel.judge(reading, self._window_s, first))
                continue
            if channel is not None:
                channel.fail(reading.quality, now_s)
            judged.append(reading)
        return judged

    def receive(self, index: int, reading: Reading, window_s: float, now_s: float) -> Reading:
        """The reading to publish for an unsolicited one of channel number `index`.

        There is no second poll: the next reading is the second answer to a value outside its predicted range.
        window_s : by how much later than its time it may have been measured, s.
        """
        channel = self._channels[index]
        if channel is None:
            return reading
        if not reading.ok:
            self._surprising.pop(index, None)
            channel.fail(reading.quality, now_s)
            return reading
        window_s += WINDOW_S
        first = self._surprising.pop(index, None)
        if first is None and channel.surprises(GaugeSample(reading.value, reading.time_s, window_s)):
            self._surprising[index] = reading
        return channel.judge(reading, window_s, first)

    def fail(self, quality: Quality, now_s: float) -> None:
        """Note that a poll has failed as a whole."""
        self._surprising.clear()
        for channel in self._channels:
            if channel is not None:
                channel.fail(quality, now_s)

    def _surprises(self, channel: Judge | None, reading: Reading) -> bool:
        if channel is None or not reading.ok:
            return False
        return channel.surprises(GaugeSample(reading.value, reading.time_s, self._window_s))
