"""What a cycle sees: the newest reading of every channel, taken together at one instant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from compd.gauge import Quality, Reading, bad


class Snapshot(NamedTuple):
    """The readings that one cycle uses, in the order of `Latest.channels`.

    time_s : monotonic seconds at which the snapshot was taken.
    """

    time_s: float
    readings: tuple[Reading, ...]


class Latest:
    """One slot per channel. Each slot has one writer, its line's thread, which swaps in an immutable
    Reading by reference; a reader copies the list. No lock is needed and none is taken."""

    def __init__(self, channels: Sequence[str]) -> None:
        """`channels`: "gauge.channel" for every channel of every gauge, each once."""
        self.channels: tuple[str, ...] = tuple(channels)
        self.index: Mapping[str, int] = {name: i for i, name in enumerate(self.channels)}
        self._slots: list[Reading] = [bad(0.0, Quality.NEVER_READ)] * len(self.channels)

    def put(self, index: int, reading: Reading) -> None:
        """Called by the channel's own line thread alone."""
        self._slots[index] = reading

    def snapshot(self, time_s: float) -> Snapshot:
        """All slots now."""
        return Snapshot(time_s, tuple(self._slots))
