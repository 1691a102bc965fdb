"""Limits on the connections of the page's server, and which one is closed for a new one.

Every host that reaches the port may connect. Connections without a token are therefore few, and a new one replaces the
oldest, so that no host can lock a person out. Each token has a share of the others.
"""

from __future__ import annotations

import resource
from dataclasses import dataclass
from typing import Protocol

from compd.page.counted_log import CountedLog

# Descriptors that the process asks the system for: more than its connections, files and pipes need.
WANTED_DESCRIPTORS = 4096


class Connection(Protocol):
    """The part of a connection that this module uses."""

    @property
    def idle(self) -> bool:
        """Whether the connection is idle: no request is being answered."""

    def drop(self) -> None:
        """Close the connection at once."""


@dataclass(frozen=True)
class ConnectionLimits:
    """unknown : most connections without a token. of_token : most of one token. known : most of all tokens."""

    unknown: int = 64
    of_token: int = 128
    known: int = 512

    @staticmethod
    def for_descriptors(count: int) -> ConnectionLimits:
        """Limits that use at most half of `count` descriptors; the rest is for files, pipes and closing connections."""
        full = ConnectionLimits()
        known = min(full.known, 3 * count // 8)
        return ConnectionLimits(min(full.unknown, count // 8), min(full.of_token, max(known // 4, 1)), known)


class Connections:
    """All open connections; used by the event loop's thread alone."""

    def __init__(self, limits: ConnectionLimits, log: CountedLog) -> None:
        self._limits = limits
        self._log = log
        # in order of arrival
        self._unknown: dict[Connection, None] = {}
        self._known: dict[str, dict[Connection, None]] = {}

    def count(self) -> tuple[int, int]:
        """Number of connections without a token, and with one."""
        return len(self._unknown), sum(map(len, self._known.values()))

    def came(self, connection: Connection) -> None:
        """Add a new connection; close the oldest one without a token if there are too many."""
        self._unknown[connection] = None
        if len(self._unknown) > self._limits.unknown:
            oldest = next(iter(self._unknown))
            self.went(oldest)
            self.closed(oldest, "closed_for_a_newcomer")

    def admit(self, connection: Connection, name: str) -> bool:
        """The connection has shown the token of this name. False if the limit is reached.

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
        """Note that a connection is closed."""
        self._unknown.pop(connection, None)
        for name, own in list(self._known.items()):
            own.pop(connection, None)
            if not own:
                del self._known[name]

    def closed(self, connection: Connection, why: str) -> None:
        """Close a connection, and count it in the log."""
        self._log.note(why)
        connection.drop()

    def note(self, what: str) -> None:
        """Count in the log what a connection did."""
        self._log.note(what)


def _oldest_idle(connections: dict[Connection, None]) -> Connection | None:
    return next((connection for connection in connections if connection.idle), None)


def raised_descriptor_limit() -> int:
    """Raise the process's limit of open files to WANTED_DESCRIPTORS or the hard limit; return the new limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = WANTED_DESCRIPTORS if hard == resource.RLIM_INFINITY else min(WANTED_DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        return wanted
    return WANTED_DESCRIPTORS if soft == resource.RLIM_INFINITY else soft
