"""Whether the replies on a line belong to the requests for which they were taken.

Most gauges on a line of bytes answer with a bare number, which says neither whose it is nor when it was asked for. A
reply that comes long after its timeout then passes for the answer to the request that is waiting, the true answer for
that of the next one, and so on: every gauge has the value of the one before, and no reply is missing or damaged. What
gives it away is that one reply more than wanted is under way after the last request. So the readings of a round wait
until the line has been silent for longer than its devices ever take to answer; where something comes, none of them
counts. What this cannot see is a late reply and, in the same round behind it, one that is lost for good.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

from compd.gauge import Gauge, replies_tell_whose

# Polls of the line of which the longest is kept in mind: some ten rounds.
POLLS_IN_MIND = 256
# Until so many are known, and one of each gauge, a reply may take as long as the line's timeout.
FEWEST_POLLS = 4
# A device may take this much longer than it ever did within the polls in mind, and
SLOWER = 1.25
# so much longer, s: an adapter hands over what has come once a millisecond.
LATER_S = 2e-3
# A line with one gauge is in doubt only after a reply was missed, and after it was opened: what was asked before may
# still be answered. A reply that is later than this, s, has been lost.
LATEST_REPLY_S = 10.0


class ReplyOrder:
    """Of one line; used by the line's thread."""

    def __init__(self, gauges: Sequence[Gauge[Any]], timeout_s: float) -> None:
        """`timeout_s`: of the line."""
        self._on_bytes = any(gauge.line_kind == "bytes" for gauge in gauges)
        self._several = self._on_bytes and len(gauges) > 1 and not replies_tell_whose(gauges)
        self._one = self._on_bytes and len(gauges) == 1
        self._timeout_s = timeout_s
        self._durations_s: deque[float] = deque(maxlen=POLLS_IN_MIND)
        self._fewest_polls = max(FEWEST_POLLS, len(gauges))
        self._in_doubt_until_s = -math.inf

    @property
    def guarded(self) -> bool:
        """Whether a late reply is found by one that is too many, and not by what stands in it."""
        return self._several or self._one

    def in_doubt(self, now_s: float) -> bool:
        """Whether a reading must wait until the line has been silent for `listen_s`."""
        return self._several or (self._one and now_s < self._in_doubt_until_s)

    @property
    def listen_s(self) -> float:
        """Time (s) within which the answer to the last request would come, if another reply was taken for it."""
        if len(self._durations_s) < self._fewest_polls:
            return self._timeout_s
        return min(self._timeout_s, SLOWER * max(self._durations_s) + LATER_S)

    def answered(self, duration_s: float) -> None:
        """A poll was answered; `duration_s`: from its request to its last byte, s."""
        self._durations_s.append(duration_s)

    def missed(self, now_s: float) -> None:
        """A reply did not come, or not whole, and may come later; or the line was opened, and it is not known."""
        self._in_doubt_until_s = now_s + LATEST_REPLY_S
