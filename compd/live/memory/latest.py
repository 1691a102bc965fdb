"""The newest reading of every channel: written by the lines' threads, read by the loop as one snapshot per cycle.

The readings are in shared memory: a version of 8 bytes for each channel, which is odd while its slot is being written
and another number after every write, and then the slots (`compd.live.memory.readings`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from compd.gauge import Quality, Reading, bad
from compd.live.memory.readings import SLOT_BYTES, Readings, contents_of, pack, take_changed
from compd.live.memory.shared_array import shared_memory

_TRIES = 2


class Snapshot(NamedTuple):
    """The readings that one cycle uses."""

    time_s: float  #: monotonic time (s) at which the snapshot was taken
    readings: Readings  #: one of every channel, in the order of `Latest.channels`; each has its own time and quality.


class Latest:
    """The newest reading of every channel; NEVER_READ until there is one.

    Each channel has one writer, the thread of its line. A reader that meets a slot which is being written looks again,
    and keeps the reading that it has where the slot stays like that: its age tells when it can no longer be used. So
    nobody waits, and no reading is ever mixed from two.
    """

    def __init__(self, channels: Sequence[str], together: Sequence[Sequence[str]] = ()) -> None:
        """`channels`: "gauge.channel" of every channel of every gauge, each once. `index` maps such a name to its
        place in `channels`. `together`: channels that are written by `put_all`."""
        self.channels: tuple[str, ...] = tuple(channels)
        self.index: Mapping[str, int] = {name: i for i, name in enumerate(self.channels)}
        count = len(self.channels)
        memory = memoryview(shared_memory(max(count, 1) * (8 + SLOT_BYTES)))
        self._versions = memory[: 8 * count].cast("Q")
        self._version_array = np.frombuffer(self._versions, dtype=np.uint64)
        self._slots = memory[8 * count : (8 + SLOT_BYTES) * count]
        self._group = np.full(count, -1)
        for number, names in enumerate(together):
            self._group[[self.index[name] for name in names]] = number
        # what this process has read so far
        self._seen = np.zeros(count, dtype=np.uint64)
        self._kept = contents_of(pack(bad(0.0, Quality.NEVER_READ)) * count).copy()

    def put(self, index: int, reading: Reading) -> None:
        """Replace the reading of the channel at `index`; called by the thread of the channel's line alone."""
        content = pack(reading)
        writing = self._versions[index] | 1  # odd already where the last writer was killed while it wrote
        self._versions[index] = writing
        self._slots[index * SLOT_BYTES : (index + 1) * SLOT_BYTES] = content
        self._versions[index] = writing + 1

    def put_all(self, readings: Mapping[int, Reading]) -> None:
        """Replace the readings of several channels, by index: of those that are `together` a snapshot has all or none.

        Called by the thread of their line alone.
        """
        contents = {index: pack(reading) for index, reading in readings.items()}
        writing = {index: self._versions[index] | 1 for index in contents}
        for index, version in writing.items():
            self._versions[index] = version
        for index, content in contents.items():
            self._slots[index * SLOT_BYTES : (index + 1) * SLOT_BYTES] = content
        for index, version in writing.items():
            self._versions[index] = version + 1

    def snapshot(self, time_s: float) -> Snapshot:
        """All readings as they are now, under the time `time_s` (s)."""
        for _ in range(_TRIES):
            before = self._version_array.copy()
            contents = contents_of(bytes(self._slots))
            after = self._version_array.copy()
            if not take_changed(before, after, self._seen, self._group, contents, self._kept):
                break
        return Snapshot(time_s, Readings(self._kept.tobytes()))
