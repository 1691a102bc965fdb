"""The browsers that look at the page: who they are, and which of them is armed, so that its orders are followed."""

from __future__ import annotations

import secrets
from dataclasses import dataclass, field

from compd.clock import Clock

# An armed browser stays so for this long, s, and no longer than its connection.
ARMED_S = 60.0


@dataclass
class Browser:
    """One connection of a browser.

    id : known to this browser alone. role : "view" or "operate". since_s, armed_until_s : monotonic time, s.
    """

    name: str
    address: str
    role: str
    since_s: float
    armed_until_s: float = 0.0
    id: str = field(default_factory=lambda: secrets.token_urlsafe(16), repr=False)


class Browsers:
    """All that are connected."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._connected: dict[str, Browser] = {}

    def connect(self, name: str, address: str, role: str) -> Browser:
        """A browser has come."""
        browser = Browser(name, address, role, self._clock.monotonic())
        self._connected[browser.id] = browser
        return browser

    def disconnect(self, browser: Browser) -> None:
        """It has gone; it is not armed any more."""
        self._connected.pop(browser.id, None)

    def arm(self, id: str) -> Browser | None:
        """Arm the browser for `ARMED_S`; None where it is not connected, or its role is to look only."""
        browser = self._connected.get(id)
        if browser is None or browser.role != "operate":
            return None
        browser.armed_until_s = self._clock.monotonic() + ARMED_S
        return browser

    def disarm(self, id: str) -> None:
        """End it at once."""
        if (browser := self._connected.get(id)) is not None:
            browser.armed_until_s = 0.0

    def armed(self, id: str) -> Browser | None:
        """The browser of this id, if it is connected and armed."""
        browser = self._connected.get(id)
        return browser if browser is not None and browser.armed_until_s > self._clock.monotonic() else None

    def summary(self) -> list[dict[str, object]]:
        """Everybody, the longest connected first; the ids stay here."""
        now_s = self._clock.monotonic()
        return [
            {
                "name": browser.name,
                "address": browser.address,
                "role": browser.role,
                "connected_s": round(now_s - browser.since_s, 1),
                "armed_s": round(max(browser.armed_until_s - now_s, 0.0), 1),
            }
            for browser in sorted(self._connected.values(), key=lambda browser: browser.since_s)
        ]
