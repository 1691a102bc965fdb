"""Shares of what the page can do at once, so that no token takes the places of the others.

A token has a quarter of the places. The tokens that only look have half of them together, so that a person who operates
finds one.
"""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from compd.page.guard import Token

# Token of the request that is being answered; None outside a request.
ASKER: ContextVar[Token | None] = ContextVar("asker", default=None)


class Share(NamedTuple):
    """most : places at once of all tokens for which `holds` is true. whose : these tokens, in words."""

    most: int
    whose: str
    holds: Callable[[Token | None], bool]


def looks_only(token: Token | None) -> bool:
    """Whether the token is one that only looks."""
    return token is not None and token.role == "view"


def shares_of(token: Token | None, most: int) -> list[Share]:
    """The shares in which a place for this token counts, the smallest first. most : places of all tokens."""
    shares = [Share(most, "", lambda holder: True)]
    if looks_only(token):
        shares.append(Share(max(most // 2, 1), "for all tokens that only look", looks_only))
    if token is not None:
        shares.append(Share(max(most // 4, 1), "for one token", lambda holder: holder == token))
    return shares[::-1]


class Places:
    """Places that are taken and given back; used by the event loop's thread alone."""

    def __init__(self, most: int) -> None:
        """most : places of all tokens."""
        self._most = most
        self._taken: list[Token | None] = []

    def take(self, token: Token | None) -> Share | None:
        """Take a place; return the share that is used up if there is none."""
        for share in shares_of(token, self._most):
            if sum(map(share.holds, self._taken)) >= share.most:
                return share
        self._taken.append(token)
        return None

    def give_back(self, token: Token | None) -> None:
        """Give a taken place back."""
        self._taken.remove(token)
