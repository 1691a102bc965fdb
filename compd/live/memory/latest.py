"""The newest reading of every channel: written by the lines' threads, read by the loop as one snapshot per cycle.

The readings are in shared memory, one slot of 224 bytes per channel after a list of versions:

    version    8 bytes for each channel: odd while its slot is being written, another number after every write
    value      8 bytes, float64, in the channel's unit; nan where there is none
    time_s     8 bytes, float64, monotonic
    motion     32 bytes, four float64, a `ReadingMotion`; nan where there is none
    quality    1 byte, number of the Quality
    length     1 byte, of the detail
    (unused)   2 bytes
    checksum   4 bytes, CRC-32 of all that is before and after it in the slot
    detail     168 bytes, UTF-8
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from compd.gauge import Quality, Reading, ReadingMotion, bad
from compd.live.memory.shared_array import shared_memory

_SLOT = struct.Struct("=ddddddBBxxI168s")
_HEAD = struct.Struct("=ddddddBBxxI")
_CHECKED = struct.Struct("=ddddddBBxx")
_CHECKED_BYTES = _CHECKED.size
SLOT_BYTES = _SLOT.size
LONGEST_DETAIL = SLOT_BYTES - _HEAD.size
_TRIES = 2
_NO_MOTION = (math.nan,) * 4

_QUALITIES = tuple(Quality)
_NUMBERS = {quality: number for number, quality in enumerate(_QUALITIES)}


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

    Each channel has one writer, the thread of its line. A reader that meets a slot which is being written looks again,
    and keeps the reading that it has where the slot stays like that: its age tells when it can no longer be used. So
    nobody waits, and no reading is ever mixed from two.
    """

    def __init__(self, channels: Sequence[str], together: Sequence[Sequence[str]] = ()) -> None:
        """`channels`: "gauge.channel" of every channel of every gauge, each once. `index` maps such a name to its
        place in `channels`. `together`: channels that are written by `put_all`."""
        self.channels: tuple[str, ...] = tuple(channels)
        self.index: Mapping[str, int] = {name: i for i, name in enumerate(self.channels)}
        self._together = [[self.index[name] for name in names] for names in together]
        count = len(self.channels)
        memory = memoryview(shared_memory(max(count, 1) * (8 + SLOT_BYTES)))
        self._versions = memory[: 8 * count].cast("Q")
        self._version_array = np.frombuffer(self._versions, dtype=np.uint64)
        self._slots = memory[8 * count :]
        # what this process has read so far
        self._seen = np.zeros(count, dtype=np.uint64)
        self._readings: list[Reading] = [bad(0.0, Quality.NEVER_READ)] * count
        self._contents = list(map(packed, self._readings))

    def put(self, index: int, reading: Reading) -> None:
        """Replace the reading of the channel at `index`; called by the thread of the channel's line alone."""
        content = packed(reading)
        writing = self._versions[index] | 1  # odd already where the last writer was killed while it wrote
        self._versions[index] = writing
        self._slots[index * SLOT_BYTES : (index + 1) * SLOT_BYTES] = content
        self._versions[index] = writing + 1

    def put_all(self, readings: Mapping[int, Reading]) -> None:
        """Replace the readings of several channels, by index: of those that are `together` a snapshot has all or none.

        Called by the thread of their line alone.
        """
        contents = {index: packed(reading) for index, reading in readings.items()}
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
            changed = np.flatnonzero(before != self._seen).tolist()
            if not changed:
                break
            slots = bytes(self._slots)
            self._take(changed, before.tolist(), self._version_array.tolist(), slots)
        return Snapshot(time_s, tuple(self._readings))

    @property
    def image(self) -> bytes:
        """The readings of the last snapshot as bytes, for `unpack_readings`."""
        return b"".join(self._contents)

    def _take(self, changed: list[int], before: list[int], after: list[int], slots: bytes) -> None:
        """Take the readings from a copy of all slots, where the versions before and after it are the same and even."""
        waiting: set[int] = set()
        for group in self._together:  # one of them is odd as long as not all are there
            if any(before[index] & 1 or before[index] != after[index] for index in group):
                waiting.update(group)
        for index in changed:
            version = before[index]
            if version & 1 or version != after[index] or index in waiting:
                continue
            start = index * SLOT_BYTES
            content = slots[start : start + SLOT_BYTES]
            reading = unpacked(content)
            if reading is not None:
                self._readings[index] = reading
                self._contents[index] = content
                self._seen[index] = version


def packed(reading: Reading) -> bytes:
    """A reading as the content of a slot; a longer detail is cut off."""
    value, time_s, quality, detail, motion = reading
    speed, braking, u, horizon_s = motion or _NO_MOTION
    text = b""
    if detail:
        text = detail.encode(errors="replace")[:LONGEST_DETAIL].decode(errors="ignore").encode()
    head = _CHECKED.pack(value, time_s, speed, braking, u, horizon_s, _NUMBERS[quality], len(text))
    checksum = zlib.crc32(text, zlib.crc32(head))
    return _SLOT.pack(value, time_s, speed, braking, u, horizon_s, _NUMBERS[quality], len(text), checksum, text)


def unpacked(content: bytes) -> Reading | None:
    """The reading in the content of a slot; None where its checksum does not fit."""
    value, time_s, speed, braking, u, horizon_s, number, length, checksum = _HEAD.unpack_from(content)
    motion = None if math.isnan(horizon_s) else ReadingMotion(speed, braking, u, horizon_s)
    if not length:
        whole = zlib.crc32(content[:_CHECKED_BYTES]) == checksum
        return Reading(value, time_s, _QUALITIES[number], "", motion) if whole else None
    text = content[_HEAD.size : _HEAD.size + length]
    if zlib.crc32(text, zlib.crc32(content[:_CHECKED_BYTES])) != checksum:
        return None
    return Reading(value, time_s, _QUALITIES[number], text.decode(), motion)


def unpack_readings(image: bytes) -> tuple[Reading, ...]:
    """The readings in an `image`, in the order of its channels. Raises ValueError for damaged ones."""
    readings = tuple(unpacked(image[start : start + SLOT_BYTES]) for start in range(0, len(image), SLOT_BYTES))
    whole = tuple(reading for reading in readings if reading is not None)
    if len(whole) < len(readings):
        raise ValueError("a damaged reading")
    return whole
