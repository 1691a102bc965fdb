"""The newest reading of every channel: written by the lines' threads, read by the loop as one snapshot per cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from compd.gauge import Quality, Reading, bad


class Snapshot(NamedTuple):
    """The readings that one cycle uses.

    Attributes
    ----------
    time_s : monotonic time (s) at which the snapshot was taken.
    readings : one of every channel, in the order of `Latest.channels`; each has its own time and quality.
    """

    time_s: float
    readings: tuple[Reading, ...]


class Latest:
    """The newest reading of every channel; NEVER_READ until there is one.

    Each channel has one writer, the thread of its line, which replaces an immutable Reading by reference; a reader
    copies all of them. So no lock is needed and none is taken.
    """

    def __init__(self, channels: Sequence[str]) -> None:
        """`channels`: "gauge.channel" of every channel of every gauge, each once. `index` maps such a name to its
        place in `channels`."""
        self.channels: tuple[str, ...] = tuple(channels)
        self.index: Mapping[str, int] = {name: i for i, name in enumerate(self.channels)}
        self._slots: list[Reading] = [bad(0.0, Quality.NEVER_READ)] * len(self.channels)

    def put(self, index: int, reading: Reading) -> None:
        """Replace the reading of the channel at `index`; called by the thread of the channel's line alone."""
        self._slots[index] = reading

    def snapshot(self, time_s: float) -> Snapshot:
        """All readings as they are now, under the time `time_s` (s)."""
        return Snapshot(time_s, tuple(self._slots))
