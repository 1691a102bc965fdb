"""Work that takes longer than the publisher may: it runs on a thread of its own and answers the client when done."""

from __future__ import annotations

import threading
from collections.abc import Callable

from compd.live.service.messages import ErrorCode, ProtocolError


class BackgroundJob:
    """Runs one piece of work at a time. It is free again before the answer goes out, so that the client that has the
    answer may ask at once for the next one."""

    def __init__(self, name: str, busy_text: str) -> None:
        """`name`: the thread's; `busy_text`: the error's text for a client that asks while work is running."""
        self._name = name
        self._busy_text = busy_text
        self._running = False
        self._thread: threading.Thread | None = None

    def start(self, work: Callable[[], bytes], answer: Callable[[bytes], None]) -> None:
        """Start `work`; `answer` gets the line that it returns. Raises ProtocolError while other work is running."""
        if self._running:
            raise ProtocolError(ErrorCode.BUSY, self._busy_text)
        self._running = True
        self._thread = threading.Thread(target=self._run, args=(work, answer), name=self._name, daemon=True)
        self._thread.start()

    def join(self, timeout_s: float | None = None) -> bool:
        """Return when nothing is running, or after `timeout_s`: whether nothing is. What still runs holds up no end."""
        if self._thread is None:
            return True
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self, work: Callable[[], bytes], answer: Callable[[bytes], None]) -> None:
        try:
            reply = work()
        finally:
            self._running = False
        answer(reply)
