"""Work that a client asked for and that neither loop nor publisher waits for: one piece at a time."""

from __future__ import annotations

import threading
from collections.abc import Callable

from compd.live.service.messages import ErrorCode, ProtocolError


class BackgroundJob:
    """A thread per piece of work. It is free again before the answer goes out: whoever has it may ask at once."""

    def __init__(self, name: str, busy: str) -> None:
        """`busy` : what a client is told that asks too early."""
        self._name = name
        self._busy = busy
        self._running = False
        self._thread: threading.Thread | None = None

    def begin(self, work: Callable[[], bytes], answer: Callable[[bytes], None]) -> None:
        """Start `work`; `answer` gets the line that it returns. Raises ProtocolError while one is running."""
        if self._running:
            raise ProtocolError(ErrorCode.BUSY, self._busy)
        self._running = True
        self._thread = threading.Thread(target=self._run, args=(work, answer), name=self._name, daemon=True)
        self._thread.start()

    def join(self) -> None:
        """Returns when nothing is running."""
        if self._thread is not None:
            self._thread.join()

    def _run(self, work: Callable[[], bytes], answer: Callable[[bytes], None]) -> None:
        try:
            reply = work()
        finally:
            self._running = False
        answer(reply)
