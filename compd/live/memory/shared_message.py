"""Python data in a shared record."""

from __future__ import annotations

import pickle
from typing import Any

from compd.live.memory.shared_record import SharedRecord

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
