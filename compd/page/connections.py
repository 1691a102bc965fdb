"""Limits on the connections of the page's server, and which one is closed for a new one.

Every host that reaches the port may connect. Connections without a token are therefore few, and a new one replaces the
oldest, so that no host can lock a person out. Each token has a share of the others. Uvicorn's `limit_concurrency` does
neither: it is one number for all, beyond which a newcomer is refused.
"""

from __future__ import annotations

import resource
from dataclasses import dataclass
from typing import TYPE_CHECKING

from compd.page.counted_log import CountedLog

if TYPE_CHECKING:
    from compd.page.limited_protocol import LimitedProtocol

# Descriptors that the process asks the system for: more than its connections, files and pipes need.
WANTED_DESCRIPTORS = 4096


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
        self.log = log
        self._limits = limits
        # name of the token that each has shown, in order of arrival
        self._token_of: dict[LimitedProtocol, str | None] = {}

    def count(self) -> tuple[int, int]:
        """Number of connections without a token, and with one."""
        unknown = len(self._of(None))
        return unknown, len(self._token_of) - unknown

    def came(self, connection: LimitedProtocol) -> None:
        """Add a new connection; close the oldest one without a token if there are too many."""
        self._token_of[connection] = None
        if len(unknown := self._of(None)) > self._limits.unknown:
            self.went(unknown[0])
            self.closed(unknown[0], "closed_for_a_newcomer")

    def admit(self, connection: LimitedProtocol, name: str) -> bool:
        """The connection has shown the token of this name. False if the limit is reached.

        A place is made by closing the oldest that is idle: of the same token where it has its share already, else of
        the token that has most, which loses one that is not idle, too.
        """
        if self._token_of.get(connection) == name:
            return True
        if connection not in self._token_of:
            return False  # it has gone meanwhile
        self._token_of[connection] = None
        own = self._of(name)
        has_share = len(own) >= self._limits.of_token
        if has_share or self.count()[1] >= self._limits.known:
            names = dict.fromkeys(filter(None, self._token_of.values()))
            most = own if has_share else max(map(self._of, names), key=len)
            leaving = [one for one in most if one.idle] or (most if most != own else [])
            if not leaving:
                self.log.note("no_place_for_a_token")
                return False
            self.went(leaving[0])
            leaving[0].drop()
        self._token_of[connection] = name
        return True

    def went(self, connection: LimitedProtocol) -> None:
        """Note that a connection is closed."""
        self._token_of.pop(connection, None)

    def closed(self, connection: LimitedProtocol, why: str) -> None:
        """Close a connection, and count it in the log."""
        self.log.note(why)
        connection.drop()

    def _of(self, name: str | None) -> list[LimitedProtocol]:
        """Connections that have shown the token of this name, or none, the oldest first."""
        return [connection for connection, token in self._token_of.items() if token == name]


def raised_descriptor_limit() -> int:
    """Raise the process's limit of open files to WANTED_DESCRIPTORS or the hard limit; return the new limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = WANTED_DESCRIPTORS if hard == resource.RLIM_INFINITY else min(WANTED_DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        return wanted
    return WANTED_DESCRIPTORS if soft == resource.RLIM_INFINITY else soft
