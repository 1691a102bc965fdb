"""How many connections the page's server keeps, and which it closes for a newcomer.

Whoever reaches the port may connect, so that connections without a token are few, and the oldest of them goes when one
more comes: nobody can keep a person out. Each token has a share of the others.
"""

from __future__ import annotations

import resource
from dataclasses import dataclass
from typing import Protocol

from compd.page.counted_log import CountedLog

# The process has that many descriptors where the system permits it: more than its connections, files and pipes need.
WANTED_DESCRIPTORS = 4096


class Connection(Protocol):
    """A connection as this module needs it."""

    @property
    def idle(self) -> bool:
        """Whether no request is being answered."""

    def drop(self) -> None:
        """Close it at once."""


@dataclass(frozen=True)
class ConnectionLimits:
    """unknown : connections that have shown no token. of_token : of one token. known : of all tokens."""

    unknown: int = 64
    of_token: int = 128
    known: int = 512

    @staticmethod
    def for_descriptors(count: int) -> ConnectionLimits:
        """At most half of the process's descriptors, `count`; the rest is for files, pipes and connections that go."""
        full = ConnectionLimits()
        known = min(full.known, 3 * count // 8)
        return ConnectionLimits(min(full.unknown, count // 8), min(full.of_token, max(known // 4, 1)), known)


class Connections:
    """All that are open; used by the event loop's thread alone."""

    def __init__(self, limits: ConnectionLimits, log: CountedLog) -> None:
        self._limits = limits
        self._log = log
        # in the order in which they came
        self._unknown: dict[Connection, None] = {}
        self._known: dict[str, dict[Connection, None]] = {}

    def count(self) -> tuple[int, int]:
        """Without a token, and with one."""
        return len(self._unknown), sum(map(len, self._known.values()))

    def came(self, connection: Connection) -> None:
        """A connection is new; where there are too many without a token, the oldest is closed."""
        self._unknown[connection] = None
        if len(self._unknown) > self._limits.unknown:
            oldest = next(iter(self._unknown))
            self.went(oldest)
            self.closed(oldest, "closed_for_a_newcomer")

    def admit(self, connection: Connection, name: str) -> bool:
        """The connection has shown the token of this name. False where there is no place for it.

        A place is made by closing the oldest that is idle: of the same token where it has its share already, else of
        the token that has most, which loses one that is not idle, too.
        """
        own = self._known.get(name, {})
        if connection in own:
            return True
        self.went(connection)
        if len(own) >= self._limits.of_token:
            leaving = _oldest_idle(own)
        elif self.count()[1] >= self._limits.known:
            most = max(self._known.values(), key=len)
            leaving = _oldest_idle(most) or (None if most is own else next(iter(most)))
        else:
            self._known.setdefault(name, {})[connection] = None
            return True
        if leaving is None:
            self._unknown[connection] = None
            self._log.note("no_place_for_a_token")
            return False
        self.went(leaving)
        leaving.drop()
        self._known.setdefault(name, {})[connection] = None
        return True

    def went(self, connection: Connection) -> None:
        """It is closed."""
        self._unknown.pop(connection, None)
        for name, own in list(self._known.items()):
            own.pop(connection, None)
            if not own:
                del self._known[name]

    def closed(self, connection: Connection, why: str) -> None:
        """Close it, and count it in the log."""
        self._log.note(why)
        connection.drop()

    def note(self, what: str) -> None:
        """Count in the log what a connection did."""
        self._log.note(what)


def _oldest_idle(connections: dict[Connection, None]) -> Connection | None:
    return next((connection for connection in connections if connection.idle), None)


def raised_descriptor_limit() -> int:
    """Let the process open WANTED_DESCRIPTORS files, or as many as it may; how many it may open now."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = WANTED_DESCRIPTORS if hard == resource.RLIM_INFINITY else min(WANTED_DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        return wanted
    return WANTED_DESCRIPTORS if soft == resource.RLIM_INFINITY else soft
