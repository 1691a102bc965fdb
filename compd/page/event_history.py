"""History of live events as they were sent: ten a second for the last minute, one a second for the hour.

The tables of the history are for charts. Here is the rest of a cycle, which a page that is frozen or scrubbed shows:
the machine's pose, what the corrections and the tip are made of, the shadow, every gauge. STATUS (timing of the loop,
clients) is not kept.
"""

from __future__ import annotations

import zlib
from bisect import bisect_left
from collections import deque
from itertools import islice

from compd.page.cadence import Cadence
from compd.page.history import COARSE_HZ, COARSE_S, FINE_HZ, FINE_S

# The fastest level: a third of the bytes in a tenth of a millisecond.
_LEVEL = 1


class _Kept:
    """The newest events, one every `1 / rate_hz` seconds, deflated."""

    def __init__(self, span_s: float, rate_hz: float) -> None:
        self.cadence = Cadence(rate_hz)
        self.times_s: deque[float] = deque(maxlen=round(span_s * rate_hz))
        self.events: deque[bytes] = deque(maxlen=round(span_s * rate_hz))

    def note(self, time_s: float, event: bytes) -> None:
        self.cadence.kept(time_s)
        self.times_s.append(time_s)
        self.events.append(event)

    def nearest(self, time_s: float) -> tuple[float, bytes] | None:
        if not self.times_s:
            return None
        after = min(bisect_left(self.times_s, time_s), len(self.times_s) - 1)
        place = min((max(after - 1, 0), after), key=lambda k: abs(self.times_s[k] - time_s))
        return self.times_s[place], next(islice(self.events, place, None))


class Moments:
    """Events of the last hour by time; used by the event loop's thread alone."""

    def __init__(self) -> None:
        self._kept = (_Kept(FINE_S, FINE_HZ), _Kept(COARSE_S, COARSE_HZ))

    def note(self, time_s: float, event: bytes) -> None:
        """Keep the event (JSON) of `time_s` (Unix, s) if one is due."""
        due = [kept for kept in self._kept if kept.cadence.is_due(time_s)]
        if due:
            deflated = zlib.compress(event, _LEVEL)
            for kept in due:
                kept.note(time_s, deflated)

    def nearest(self, time_s: float) -> bytes | None:
        """The stored event nearest to `time_s`; None before the first."""
        moments = [moment for moment in (kept.nearest(time_s) for kept in self._kept) if moment is not None]
        return zlib.decompress(min(moments, key=lambda moment: abs(moment[0] - time_s))[1]) if moments else None
