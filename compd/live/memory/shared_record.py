"""Bytes that one process replaces now and then, and others read: the old ones or the new ones, never a mixture.

A record is a header of 16 bytes and the content:

    version    8 bytes: odd while the record is being written, and another number after every write
    length, checksum   one word of 8 bytes: the length times 2**32, plus the CRC-32 of the content
    content    `length` bytes

A reader copies the content, then looks whether the version is even and has stayed the same, and whether the checksum
fits. The checksum is for processors that do not keep the order of writes, and for a writer that was killed in between.
Nobody waits for anybody: a reader that finds no whole record keeps what it has and looks again later.
"""

from __future__ import annotations

import zlib

from compd.live.memory.shared_array import shared_memory

HEADER_BYTES = 16
# How often a reader looks again at once. A writer needs a microsecond; one that was suspended in between needs longer
# than anybody should wait.
_TRIES = 4
_CHECKSUM_BITS = 32


class SharedRecord:
    """One record. Exactly one process writes it at any time."""

    def __init__(self, capacity: int) -> None:
        """`capacity`: bytes that the content may have at most. Memory is used as far as it has been written."""
        self.capacity = capacity
        self._bytes = memoryview(shared_memory(HEADER_BYTES + capacity))
        self._words = self._bytes[:HEADER_BYTES].cast("Q")

    @property
    def version(self) -> int:
        """0 before the first write, and another number after each; to see whether there is anything new."""
        return self._words[0]

    def write(self, content: bytes) -> None:
        """Replace the content. Raises ValueError where it is longer than `capacity`."""
        if len(content) > self.capacity:
            raise ValueError(f"{len(content)} bytes, at most {self.capacity}")
        writing = self._words[0] | 1  # odd already where the last writer was killed while it wrote
        self._words[0] = writing
        self._bytes[HEADER_BYTES : HEADER_BYTES + len(content)] = content
        self._words[1] = len(content) << _CHECKSUM_BITS | zlib.crc32(content)
        self._words[0] = writing + 1

    def read(self) -> bytes | None:
        """The content; b"" before the first write, None where no whole one was seen."""
        for _ in range(_TRIES):
            version = self._words[0]
            length, checksum = divmod(self._words[1], 1 << _CHECKSUM_BITS)
            content = bytes(self._bytes[HEADER_BYTES : HEADER_BYTES + length])
            if not version & 1 and version == self._words[0] and zlib.crc32(content) == checksum:
                return content
        return None
