"""Polling interval of an unresponsive gauge whose silence makes the others on its line stale.

A gateway before a serial bus serves no unit while it waits for one that does not answer, whatever the line's timeout
is. What such a request has cost is known when the next gauge answers. Where that gauge's reading has gone stale
meanwhile, twice in a row, the silent gauge is asked again only after `TIMES_COST` as long. A gauge that costs no other
gauge a reading rests as `PolledGauge` has it.
"""

from __future__ import annotations

import structlog

from compd.live.acquisition.polled_gauge import PolledGauge

log = structlog.get_logger()

# An absent gauge takes at most 1 % of its line's time: the rest after a missed reply, in times of its cost.
TIMES_COST = 100
# Missed replies in a row that count as an absence; a single reply may get lost.
MISSES = 2


class AbsentGauges:
    """Absent gauges of one line; used by the line's thread."""

    def __init__(self) -> None:
        self._asked_s: dict[PolledGauge, float] = {}  # time of a poll without an answer since another gauge answered
        self._misses: dict[PolledGauge, int] = {}  # consecutive misses that made another gauge's reading stale

    def missed(self, gauge: PolledGauge, asked_s: float) -> None:
        """`gauge` was asked at the monotonic time `asked_s` (s), and did not answer."""
        self._asked_s[gauge] = asked_s

    def answered(self, gauge: PolledGauge, now_s: float) -> None:
        """`gauge` answers at the monotonic time `now_s` (s); its new readings are not published yet."""
        self._misses.pop(gauge, None)
        self._asked_s.pop(gauge, None)
        if self._asked_s:
            # gauges polled after the first may have waited behind it in the gateway's queue
            absent, asked_s = next(iter(self._asked_s.items()))
            if gauge.fresh(asked_s) and not gauge.fresh(now_s):
                self._count(absent, now_s - asked_s, now_s)
            self._asked_s.clear()

    def _count(self, absent: PolledGauge, cost_s: float, now_s: float) -> None:
        misses = self._misses[absent] = self._misses.get(absent, 0) + 1
        if misses < MISSES:
            return
        rest_s = TIMES_COST * cost_s
        absent.rests_until_s = now_s + rest_s
        if misses == MISSES:
            log.warning("gauge is polled seldom", gauge=absent.name, cost_s=round(cost_s, 3), rest_s=round(rest_s, 1))
