"""A person accepts gauges, and is told what has become of it: one that moves or that others contradict is not believed.

A gauge is believed from two answers on that agree. What other gauges contradict is doubted again within tenths of a
second, so that the answer waits for a second.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import partial

import structlog

from compd.live.memory import Doubt, TrustMemory
from compd.live.service.message_keys.answers import AcceptKeys
from compd.live.system import System

# Votes look at 0.3 s of readings at most. Of a gauge that is read less often it is told that it has not been read yet.
WATCHED_S = 1.0
_LOOK_EVERY_S = 0.02
_NO_TWO_ANSWERS = "no two answers of it agree yet: it moves, or is read seldom; it is believed when two do"
_SUSPECTED = "it stands while all others move: let all stand still, then `compd accept` it"

_log = structlog.get_logger()


class Acceptance:
    """Accepts gauges; each order is watched by a thread of its own."""

    def __init__(self, trust: TrustMemory, system: System) -> None:
        self._trust, self._system = trust, system

    def start(self, gauge: str, answer: Callable[[bytes], None]) -> None:
        """Have the channels of a gauge believed; `answer` gets the ACCEPT line.

        gauge : its name, a "gauge.channel", or "all". Raises ValueError, with a text for the client, for none.
        """
        channels = self._trust.accept(gauge)
        self._system.thread(partial(self._watch, gauge, channels, answer), "acceptance").start()

    def _watch(self, gauge: str, channels: Sequence[str], answer: Callable[[bytes], None]) -> None:
        never = threading.Event()
        start_s = self._system.monotonic()
        since_s: dict[str, float] = {}
        while channels and (now_s := self._system.monotonic()) < start_s + WATCHED_S:
            for channel in channels:
                if self._is_believed(channel):
                    since_s.setdefault(channel, now_s)
                else:
                    since_s.pop(channel, None)
            self._system.wait(never, _LOOK_EVERY_S)
        now_s = self._system.monotonic()
        not_believed = {channel: self._reason(channel) for channel in channels if channel not in since_s}
        believed_for_s = {channel: round(now_s - begin_s, 3) for channel, begin_s in since_s.items()}
        _log.warning("gauges accepted", gauge=gauge, channels=list(since_s), not_believed=not_believed)
        answer(
            AcceptKeys.line(
                gauges=list(since_s), believed_for_s=believed_for_s or None, not_believed=not_believed or None
            )
        )

    def _is_believed(self, channel: str) -> bool:
        trust, i = self._trust, self._trust.index[channel]
        obeyed = trust.accepted[i] == trust.obeyed[i]
        return bool(obeyed and trust.doubt_of(i) is Doubt.NONE and not trust.suspected[i])

    def _reason(self, channel: str) -> str:
        trust, i = self._trust, self._trust.index[channel]
        if trust.accepted[i] != trust.obeyed[i]:
            return _NO_TWO_ANSWERS
        return trust.explanation(i) or (_SUSPECTED if trust.suspected[i] else _NO_TWO_ANSWERS)
