"""The judgement of one gauge's readings: which polls are asked twice, and what of them is published."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

from compd.clock import Clock
from compd.gauge import Quality, Reading
from compd.live.acquisition.possible_motion import WINDOW_S, GaugeSample
from compd.live.acquisition.quantity_trust import QuantityTrust
from compd.live.acquisition.reading_trust import ReadingTrust

# Of a length, and of any other quantity.
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
        self._surprising: dict[int, Reading] = {}  # by place: came unasked, and waits for the next

    def read(self, ask: Callable[[], Sequence[Reading]]) -> Sequence[Reading]:
        """The readings of one poll by `ask`, or of a second one where a value is not where its last readings lead.

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
        """Readings, and how much longer than the shortest poll theirs has taken, s.

        So late the device may have sampled: it does so at the same time after each request, but for delays on the way.
        """
        start_s = self._clock.monotonic()
        readings = ask()
        duration_s = self._clock.monotonic() - start_s
        self._shortest_s = min(self._shortest_s, duration_s)
        return readings, duration_s - self._shortest_s + WINDOW_S

    def judge(self, readings: Sequence[Reading], now_s: float) -> list[Reading]:
        """The readings of the last poll, one per channel, as they may be published."""
        firsts = self._first or [None] * len(readings)
        judged = []
        for channel, reading, first in zip(self._channels, readings, firsts, strict=True):
            if channel is not None and reading.ok:
                judged.append(channel.judge(reading, self._window_s, first))
                continue
            if channel is not None:
                channel.fail(reading.quality, now_s)
            judged.append(reading)
        return judged

    def hear(self, index: int, reading: Reading, window_s: float, now_s: float) -> Reading:
        """A reading of the channel number `place` that came unasked, as it may be published.

        Nobody can ask again: where a value is not where its last readings lead, the next reading is the second answer.
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
