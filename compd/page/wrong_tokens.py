"""Rate limit for wrong tokens, one a second for each address: against guessing, without blocking other addresses."""

from __future__ import annotations

from compd.clock import Clock
from compd.live.service import WRONG_TOKEN_REST_S

# Most waiting addresses. Beyond it all addresses wait, since they belong to one attacker.
_MOST_ADDRESSES = 256


class WrongTokens:
    """Addresses that have just shown a wrong token; used by the event loop's thread alone."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._until_s: dict[str, float] = {}

    def may_try(self, address: str) -> bool:
        """Whether a token from this address is checked."""
        now_s = self._clock.monotonic()
        self._until_s = {waiting: until_s for waiting, until_s in self._until_s.items() if until_s > now_s}
        return address not in self._until_s and len(self._until_s) < _MOST_ADDRESSES

    def note(self, address: str) -> None:
        """Note a wrong token from this address."""
        self._until_s[address] = self._clock.monotonic() + WRONG_TOKEN_REST_S
