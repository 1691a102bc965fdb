"""The connected browsers and their users, and which of them is armed to give orders."""

from __future__ import annotations

import secrets
from dataclasses import dataclass, field

from compd.clock import Clock
from compd.page.guard import Token

# Duration (s) of arming; it ends with the connection at the latest.
ARMED_S = 60.0


@dataclass
class Browser:
    """One connection of a browser.

    token : with which it came; orders with its id and another token are another person's. id : known to this browser
    alone. since_s, armed_until_s : monotonic time, s.
    """

    token: Token
    address: str
    since_s: float
    armed_until_s: float = 0.0
    id: str = field(default_factory=lambda: secrets.token_urlsafe(16), repr=False)


class Browsers:
    """All connected browsers."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._connected: dict[str, Browser] = {}

    def connect(self, token: Token, address: str) -> Browser:
        """Add a browser."""
        browser = Browser(token, address, self._clock.monotonic())
        self._connected[browser.id] = browser
        return browser

    def disconnect(self, browser: Browser) -> None:
        """Remove a browser, and disarm it."""
        self._connected.pop(browser.id, None)

    def why_not(self, id: str, token: Token) -> str:
        """Reason why this token may neither arm the browser of this id nor end it; "" if it may."""
        browser = self._connected.get(id)
        if browser is None:
            return "this browser is not connected"
        return "" if browser.token == token else "this browser is connected with another token"

    def arm(self, id: str, token: Token) -> Browser | None:
        """Arm the browser for `ARMED_S`; None if it is connected with another token or may only look."""
        if self.why_not(id, token) or token.role != "operate":
            return None
        browser = self._connected[id]
        browser.armed_until_s = self._clock.monotonic() + ARMED_S
        return browser

    def disarm(self, id: str, token: Token) -> bool:
        """End it at once; False if the browser is connected with another token."""
        if self.why_not(id, token):
            return False
        self._connected[id].armed_until_s = 0.0
        return True

    def armed(self, id: str, token: Token) -> Browser | None:
        """The browser of this id if it is armed and connected with this token."""
        browser = self._connected.get(id)
        return None if browser is None or self.why_not(id, token) or not self._is_armed(browser) else browser

    def _is_armed(self, browser: Browser) -> bool:
        return browser.armed_until_s > self._clock.monotonic()

    def summary(self) -> list[dict[str, object]]:
        """All browsers without their ids, the longest connected first."""
        now_s = self._clock.monotonic()
        return [
            {
                "name": browser.token.name,
                "address": browser.address,
                "role": browser.token.role,
                "connected_s": round(now_s - browser.since_s, 1),
                "armed_s": round(max(browser.armed_until_s - now_s, 0.0), 1),
            }
            for browser in sorted(self._connected.values(), key=lambda browser: browser.since_s)
        ]
