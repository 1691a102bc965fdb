"""A ring through which entries go from the loop to the service, without either waiting for the other.

The memory begins with a head of 16 bytes, and has `ENTRIES` places of the same size after it, 64 KiB or more:

    count      8 bytes: how many entries have ever been written; entry k is at place k modulo `ENTRIES`
    due        8 bytes, float64: monotonic time from which on the reader wants to be woken

    version    8 bytes: 2 k + 1 while entry k is being written, 2 k + 2 once it is whole
    time_s     8 bytes, float64: monotonic time of the cycle
    state      8 bytes: number of the setpoint's state
    length, checksum   one word of 8 bytes: the length times 2**32, plus the CRC-32 of the content
    content    `length` bytes
"""

from __future__ import annotations

import math
import os
import zlib
from collections.abc import Callable, Iterator

from compd.live.memory.shared_array import shared_memory

# Half a second at 1 kHz: longer than any pause of the service that is not a fault.
ENTRIES = 512
# Ten times what a cycle of a hexapod with ten effects needs, and for larger machines so much for each channel. Memory
# that is not used costs nothing.
_MIN_PLACE_BYTES = 64 * 1024
_CHANNEL_BYTES = 1024
_HEAD_BYTES = 16
_HEADER_BYTES = 32
_CHECKSUM_BITS = 32
# Entries that may be written while one is read.
_MARGIN = 16


class SharedRing:
    """A ring. One loop writes it at any time; whoever reads keeps count of what has been read."""

    def __init__(self, channels: int = 0) -> None:
        """`channels`: of the machine, whose readings an entry may have."""
        self._place_bytes = max(_MIN_PLACE_BYTES, channels * _CHANNEL_BYTES)
        self.longest_content = self._place_bytes - _HEADER_BYTES  #: bytes that an entry may have
        memory = memoryview(shared_memory(_HEAD_BYTES + ENTRIES * self._place_bytes))
        self._count = memory[:8].cast("Q")
        self._due_s = memory[8:16].cast("d")
        self._due_s[0] = math.inf
        self._places = memory[_HEAD_BYTES:]
        self._words = self._places.cast("Q")
        self._times = self._places.cast("d")
        self._last_state = -1
        self.woken = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)

    @property
    def count(self) -> int:
        """How many entries have ever been written."""
        return self._count[0]

    def wake_from(self, time_s: float) -> None:
        """Ask to be woken, through `woken`, by the first entry that is not older than `time_s` (s), and by each one
        of a new state."""
        self._due_s[0] = time_s

    def put(self, time_s: float, state: int, content: bytes) -> None:
        """Write an entry in the place of the oldest one. Raises ValueError for content that is too long."""
        if len(content) > self.longest_content:
            raise ValueError(f"{len(content)} bytes, at most {self.longest_content}")
        number = self._count[0]
        start = number % ENTRIES * self._place_bytes
        word = start // 8
        self._words[word] = 2 * number + 1
        self._times[word + 1] = time_s
        self._words[word + 2] = state
        self._words[word + 3] = len(content) << _CHECKSUM_BITS | zlib.crc32(content)
        self._places[start + _HEADER_BYTES : start + _HEADER_BYTES + len(content)] = content
        self._words[word] = 2 * number + 2
        self._count[0] = number + 1
        if time_s >= self._due_s[0] or state != self._last_state:
            self._last_state = state
            self.wake_reader()

    def wake_reader(self) -> None:
        """Wake the reader through `woken`, whatever for; called by any process."""
        os.eventfd_write(self.woken, 1)

    def when(self, number: int) -> tuple[float, int]:
        """Time (s) and state's number of entry `number`, which must be among the last ones."""
        word = number % ENTRIES * self._place_bytes // 8
        return self._times[word + 1], self._words[word + 2]

    def get(self, number: int) -> bytes | None:
        """The content of entry `number`, counted from 0; None where newer ones have its place, or it is not whole."""
        start = number % ENTRIES * self._place_bytes
        word = start // 8
        version = self._words[word]
        length, checksum = divmod(self._words[word + 3], 1 << _CHECKSUM_BITS)
        content = bytes(self._places[start + _HEADER_BYTES : start + _HEADER_BYTES + length])
        whole = version == 2 * number + 2 == self._words[word] and zlib.crc32(content) == checksum
        return content if whole else None

    def close(self) -> None:
        """Close `woken`."""
        os.close(self.woken)


class RingReader:
    """Reads a ring from the oldest entry on that it has."""

    def __init__(self, ring: SharedRing) -> None:
        self.ring = ring
        self.dropped = 0  #: entries that the ring no longer had when they were to be read
        self._next = 0

    def contents(self, is_due: Callable[[float, int], bool]) -> Iterator[bytes]:
        """The contents of the entries that are new and due; the others are passed over.

        is_due : asked with time (s) and state's number of each, when all before it have been dealt with.
        """
        count = self.ring.count
        if (behind := count - self._next - ENTRIES + _MARGIN) > 0:
            self.dropped += behind
            self._next += behind
        while self._next < count:
            number = self._next
            self._next += 1
            if is_due(*self.ring.when(number)):
                content = self.ring.get(number)
                if content is None:
                    self.dropped += 1
                else:
                    yield content
