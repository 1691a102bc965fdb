"""Python data in a shared record.

Bytes that one process replaces now and then, and others read: the old ones or the new ones, never a mixture.

A record is a header of 16 bytes and the content:

    version    8 bytes: odd while the record is being written, and another number after every write
    length, checksum   one word of 8 bytes: the length times 2**32, plus the CRC-32 of the content
    content    `length` bytes

A reader copies the content, then looks whether the version is even and has stayed the same, and whether the checksum
fits. The checksum is for processors that do not keep the order of writes, and for a writer that was killed in between.
Nobody waits for anybody: a reader that finds no whole record keeps what it has and looks again later.
"""

from __future__ import annotations

import pickle
import zlib
from typing import Any

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


# A machine zero, a summary of models, a list of problems. Memory that is not used costs nothing.
_USUAL_BYTES = 256 * 1024


class SharedMessage:
    """Data that one process replaces and others read. They get the same object until it is replaced."""

    def __init__(self, capacity: int = _USUAL_BYTES) -> None:
        """`capacity`: bytes that the pickled data may have at most."""
        self._record = SharedRecord(capacity)
        self._version = 0
        self._data: Any = None

    @property
    def version(self) -> int:
        """Another number after every write."""
        return self._record.version

    def write(self, data: Any) -> None:
        """Replace the data. Raises ValueError where they are too long."""
        self._record.write(pickle.dumps(data))

    def read(self) -> Any:
        """The data; None before the first write."""
        if (version := self._record.version) != self._version and (content := self._record.read()):
            self._data, self._version = pickle.loads(content), version
        return self._data
