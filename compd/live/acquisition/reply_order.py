"""Check that the replies on a line belong to the requests to which they were assigned.

Most gauges on a line of bytes answer with a bare number, which says neither whose it is nor when it was asked for. A
reply that comes long after its timeout then passes for the answer to the request that is waiting, the true answer for
that of the next one, and so on: every gauge has the value of the one before, and no reply is missing or damaged. What
gives it away is that one reply more than wanted is under way after the last request. So the readings of a round wait
until any answer to the last request would be there, since devices hardly take longer than they ever do; where
something comes, none of them counts. After a missed reply, that silence is longer than the longest time between two
requests since then: if every reply is late from now on, they come at the intervals of their requests. The round that
ends with it does not count either, since another reply may have been lost. What this cannot see is a reply of an
earlier round that comes while another is lost for good.

A line with one gauge listens for a shorter time. The first answer after a missed reply is thrown away, and the gauge
is asked again at once: no two requests before were so close, so that an answer which comes as quickly as ever, with
nothing behind it, belongs to the second of them. Where something comes behind it, the same is tried once more. With
a timeout of 0.15 s, a gauge that misses two replies in a row, or is late by 0.25 s, is back within 0.5 s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from compd.gauge import Gauge, replies_tell_whose
from compd.lines import USUAL_SHARE, Durations

# Fewest polls, at least one of each gauge, before a reply must be faster than the line's timeout.
MIN_POLLS = 4
# Largest duration of a reply, relative to the longest usual one: nearly all of the last 256, since this computer may
# pause, which is no slowness of the device; and
SLOWER = 1.25
# its largest excess (s): an adapter hands over received bytes once a millisecond.
LATER_S = 2e-3
# Latest arrival (s) of a reply; a later one is lost. A line with one gauge is in doubt after a missed reply and after
# its opening, since earlier requests may still be answered.
MAX_REPLY_S = 10.0
# Longest time (s) to listen after a missed reply: the largest interval of requests, except for gauges that are polled
# seldom.
MAX_LISTEN_S = 2.0
# Share of quick answers; the others waited for the device or for this computer.
NEARLY_EVERY = 0.9
# Requests are close together if the next one follows within this many times the time of a quick answer.
CLOSE = 2.0
# Largest excess (s) of the interval of two late replies over that of their requests.
JITTER_S = 10e-3


class ReplyOrder:
    """Order of the replies on one line; used by the line's thread."""

    def __init__(self, gauges: Sequence[Gauge[Any]], timeout_s: float) -> None:
        """`timeout_s`: of the line."""
        self._on_bytes = any(gauge.line_kind == "bytes" for gauge in gauges)
        self._several = self._on_bytes and len(gauges) > 1 and not replies_tell_whose(gauges)
        self._one = self._on_bytes and len(gauges) == 1
        received = [length for gauge in gauges for _, length in gauge.traffic() or [(0, 0)]]
        self._shortest = min(received, default=0)  # length of the replies in bytes; 0 if unknown
        self._timeout_s = timeout_s
        self._durations = Durations()
        self._fewest_polls = max(MIN_POLLS, len(gauges))
        self._in_doubt_until_s = -math.inf
        self._in_step = False
        self._asked_s = math.nan  # time of the last request
        self._apart_s = 0.0  # longest interval of requests since the line was in step
        self._closest_s = math.inf  # and the shortest one
        self._quick = False  # whether a gauge polled again at once has answered as quickly as ever

    @property
    def guarded(self) -> bool:
        """Whether a late reply is found by a surplus reply, not by its content."""
        return self._several or self._one

    @property
    def in_step(self) -> bool:
        """Whether every reply to an earlier request has arrived or is lost."""
        return self._in_step or self._quick

    def in_doubt(self, now_s: float) -> bool:
        """Whether a reading must wait until the line has been silent for that long."""
        return self._several or (self._one and now_s < self._in_doubt_until_s)

    def listen_s(self, passed_s: float) -> float:
        """Time (s) within which the answer to the last request would come, if another reply was taken for it.

        passed_s : since that request, s.
        """
        if self._quick:
            return self._quickly_s()
        if not self._in_step and self._apart_s > 0.0:
            return min(self._apart_s + JITTER_S, MAX_LISTEN_S)
        if not self._in_step or len(self._durations) < self._fewest_polls:
            return self._timeout_s
        return min(self._timeout_s, max(SLOWER * self._durations.within_s(USUAL_SHARE) - passed_s, 0.0) + LATER_S)

    def asks_twice(self) -> bool:
        """Whether to discard the next answer and poll the gauge again at once, after a `pause_s`."""
        if not self._one or self._in_step or len(self._durations) < self._fewest_polls:
            return False
        return self.pause_s() < min(self._closest_s, self._timeout_s)

    def pause_s(self) -> float:
        """Time (s) after which the next request is not close to the last one."""
        return CLOSE * self._quickly_s()

    def answered_again(self, duration_s: float) -> None:
        """The second of two requests that were close together was answered within `duration_s`, s."""
        self._quick = duration_s <= self._quickly_s()

    def _quickly_s(self) -> float:
        """Time (s) of a quick answer: nearly every answer arrives within it."""
        return SLOWER * self._durations.within_s(NEARLY_EVERY) + LATER_S

    def asked(self, now_s: float) -> None:
        """Note a request made now."""
        if not self._in_step and not math.isnan(self._asked_s):
            self._apart_s = max(self._apart_s, now_s - self._asked_s)
            self._closest_s = min(self._closest_s, now_s - self._asked_s)
        self._asked_s = now_s

    def opened(self, now_s: float) -> None:
        """The line is new: its earlier requests and their times are unknown."""
        self.missed(now_s)
        self._asked_s, self._apart_s, self._closest_s = math.nan, 0.0, 0.0

    def answered(self, duration_s: float) -> None:
        """A request was answered; `duration_s`: from then to the reply's last byte, s."""
        self._durations.note(duration_s)

    def missed(self, now_s: float, absent: bool = False) -> None:
        """A reply is missing or incomplete, and may come later.

        absent : of a gauge that did not answer before either, while others on its line may: the line is not late.
        """
        self._in_doubt_until_s = now_s + MAX_REPLY_S
        self._in_step = self._in_step and absent
        self._quick = False

    def damaged(self, now_s: float) -> None:
        """A damaged reply came, then silence for `rest_s`.

        Where the line was in step it was that of the last request, and the line still is. Readings wait as after a
        missed reply, in case that it was noise, and the reply is later than any before.
        """
        if self._in_step and len(self._durations) >= self._fewest_polls:
            self._in_doubt_until_s = now_s + MAX_REPLY_S
            self._quick = False
        else:
            self.missed(now_s)

    def is_noise(self, count: int) -> bool:
        """Whether this many surplus bytes are too few for a reply of a line with one gauge."""
        return self._one and count < self._shortest

    def rest_s(self, passed_s: float) -> float:
        """Time (s) within which what belongs to the last reply will have come. passed_s : since its request, s."""
        return self.listen_s(passed_s) if self._in_step else self._timeout_s

    def kept_silent(self) -> None:
        """Silence for `listen_s` after an answer: no reply is pending any more."""
        self._in_step, self._quick = True, False
        self._apart_s, self._closest_s = 0.0, math.inf
