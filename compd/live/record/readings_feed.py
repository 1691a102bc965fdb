"""The readings of a daemon that may end and start again."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from compd.clock import Clock
from compd.errors import DaemonError
from compd.live.record.table_rows import Message

# Wait (s) for a starting daemon, which takes seconds; waiting costs it nothing.
_TRY_EVERY_S = 0.5


class ReadingsClient(Protocol):
    """What a recorder needs of `compd.client.Client`."""

    version: dict[str, Any]

    def readings(self, rate_hz: float | None = None) -> Iterator[tuple[bytes, dict[str, Any]]]: ...

    def close(self) -> None: ...


class FeedItem(NamedTuple):
    """One READINGS or ORDER message, the line in which it came, and the VERSION and WATCH of the connection."""

    first_messages: tuple[Message, Message]
    line: bytes
    message: Message


@dataclass(frozen=True)
class _Connection:
    client: ReadingsClient
    first_messages: tuple[Message, Message]
    lines: Iterator[tuple[bytes, Message]]


class ReadingsFeed:
    """READINGS messages of one daemon after the other on the same socket.

    Attributes
    ----------
    first_messages : VERSION and the answer to WATCH of the present connection.
    """

    def __init__(
        self,
        connect: Callable[[], ReadingsClient],
        rate_hz: float | None,
        report: Callable[[str], None],
        clock: Clock,
    ) -> None:
        """Connect. Raises DaemonError where no daemon answers, or it refuses.

        Parameters
        ----------
        connect : opens a connection to the daemon; raises DaemonError.
        rate_hz : messages per second; None for one of every cycle.
        report : called with sentences for the user.
        clock : of this computer, which is also the daemon's.
        """
        self._connect = connect
        self._rate_hz = rate_hz
        self._report = report
        self._clock = clock
        self._never = threading.Event()
        self._connection = self._open()

    @property
    def first_messages(self) -> tuple[Message, Message]:
        return self._connection.first_messages

    def messages(self, for_s: float | None = None) -> Generator[FeedItem, None, None]:
        """Iterate over the messages for `for_s` seconds of the daemon's time; None is for ever.

        When the daemon goes away, that is reported, and the iterator waits until one answers at the same place.
        """
        end_s = math.inf
        while True:
            connection = self._connection
            try:
                for line, message in connection.lines:
                    if for_s is not None and end_s == math.inf:
                        end_s = message["time_s"] + for_s
                    elif message["time_s"] >= end_s:
                        return
                    yield FeedItem(connection.first_messages, line, message)
            except DaemonError as error:
                gone = error.problems[0].what
            finally:
                connection.client.close()
            if not self._is_back(gone, end_s):
                return

    def _open(self) -> _Connection:
        client = self._connect()
        try:
            lines = client.readings(self._rate_hz)
            _, watch = next(lines)
        except DaemonError:
            client.close()
            raise
        return _Connection(client, (client.version, watch), lines)

    def _is_back(self, gone: str, end_s: float) -> bool:
        """Wait until a daemon answers again; False where `end_s` comes first."""
        gone_s = self._clock.monotonic()
        self._report(f"{gone}; the recording goes on when it is back")
        config_hash = self.first_messages[0]["config_hash"]
        while True:
            if self._clock.monotonic() >= end_s:
                return False
            self._clock.wait(self._never, _TRY_EVERY_S)
            try:
                self._connection = self._open()
            except DaemonError:
                continue
            break
        self._report(f"the daemon is back: nothing was recorded for {self._clock.monotonic() - gone_s:.1f} s")
        if self.first_messages[0]["config_hash"] != config_hash:
            self._report(
                "its configuration is another one now: keep both, `compd recording replay` needs each for its parts"
            )
        return True
