"""Wrong tokens: from one address one is tried in a second, so that nobody guesses one, nor keeps others from trying."""

from __future__ import annotations

from compd.clock import Clock
from compd.live.service import WRONG_TOKEN_REST_S

# Addresses that wait. Where there are more, all wait: they are one person's.
_MOST_ADDRESSES = 256


class WrongTokens:
    """Who has shown one a moment ago; used by the event loop's thread alone."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._until_s: dict[str, float] = {}

    def may_try(self, address: str) -> bool:
        """Whether a token from this address is looked at."""
        now_s = self._clock.monotonic()
        self._until_s = {waiting: until_s for waiting, until_s in self._until_s.items() if until_s > now_s}
        return address not in self._until_s and len(self._until_s) < _MOST_ADDRESSES

    def note(self, address: str) -> None:
        """A wrong one came from this address."""
        self._until_s[address] = self._clock.monotonic() + WRONG_TOKEN_REST_S
