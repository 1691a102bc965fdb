"""A gauge on its line: where its readings go, what became of its polls, and when it has to rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import structlog

from compd.gauge import Gauge, Quality, Reading, bad
from compd.readings import Latest

log = structlog.get_logger()

# The request's last bit leaves a little after the write; a reading from further ahead has another clock.
AHEAD_S = 0.05


class BackOff:
    """Waiting times: the first, then doubling up to the longest; `succeeded` begins anew."""

    def __init__(self, first_s: float, longest_s: float) -> None:
        self._first_s = first_s
        self._longest_s = longest_s
        self._next_s = first_s

    def failed(self) -> float:
        """How long (s) to wait now."""
        wait_s = self._next_s
        self._next_s = min(2 * wait_s, self._longest_s)
        return wait_s

    def succeeded(self) -> None:
        """All is well: the next wait is the first again."""
        self._next_s = self._first_s


class PolledGauge:
    """One gauge on its line: its driver, its slots in Latest, and what became of its polls.

    polls, ok : how often it was asked, and how often every channel had a value.
    faults : per quality, in how many polls a channel or the whole gauge had it.
    """

    def __init__(self, name: str, driver: Gauge[Any], latest: Latest, back_off_s: tuple[float, float]) -> None:
        self.name = name
        self.driver = driver
        self.polls = 0
        self.ok = 0
        self.faults: dict[Quality, int] = dict.fromkeys(Quality, 0)  # all keys from the start: read by other threads
        self.quality = Quality.NEVER_READ
        self.detail = ""
        self.last_ok_s = math.nan
        self.rests_until_s = -math.inf
        self.reported = False
        self._misses = 0
        self._back_off = BackOff(*back_off_s)
        self._latest = latest
        self._slots = [latest.index[f"{name}.{channel.name}"] for channel in driver.channels]

    def put(self, readings: Sequence[Reading], now_s: float) -> None:
        """The channels' readings, in order; counts them.

        Raises TypeError, ValueError for what is no reading: the driver is at fault.
        """
        if len(readings) != len(self._slots):
            raise ValueError(f"{len(readings)} readings for {len(self._slots)} channels")
        worst = None
        for reading in readings:
            if not reading.time_s <= now_s + AHEAD_S:
                raise ValueError(f"reading of time {reading.time_s}, it is {now_s}")
            if reading.quality is not Quality.OK:
                worst = reading
            elif not math.isfinite(reading.value):
                raise ValueError(f"{reading.value} given as ok")
        for slot, reading in zip(self._slots, readings, strict=True):
            self._latest.put(slot, reading)
        self.polls += 1
        if worst is None:
            self.ok += 1
            self.last_ok_s = now_s
        else:
            for quality in {reading.quality for reading in readings} - {Quality.OK}:
                self.faults[quality] += 1
        self._misses = 0
        self._back_off.succeeded()
        self._report(worst.quality if worst else Quality.OK, worst.detail if worst else "")

    def fail(self, quality: Quality, detail: str, now_s: float) -> None:
        """The poll failed as a whole: every channel takes `quality`, and the gauge may have to rest.

        A missing reply may still come, so nothing is asked until it has had time; other faults are retried once.
        """
        self.polls += 1
        self.lose(quality, detail, now_s)
        self._misses += 1
        if quality is Quality.TIMEOUT or self._misses > 1:
            self.rests_until_s = now_s + self._back_off.failed()

    def lose(self, quality: Quality, detail: str, now_s: float) -> None:
        """Every channel takes `quality`, without a poll: the line is not there."""
        for slot in self._slots:
            self._latest.put(slot, bad(now_s, quality, detail))
        self.faults[quality] += 1
        self._report(quality, detail)

    def awake(self) -> None:
        """The line is new: ask at once."""
        self.rests_until_s = -math.inf

    def _report(self, quality: Quality, detail: str) -> None:
        """Into the log when it changes; a line's loss is the line's own message."""
        if quality is not self.quality and Quality.LINE_LOST not in (quality, self.quality):
            say = log.info if quality is Quality.OK else log.warning
            say("gauge", gauge=self.name, quality=str(quality), was=str(self.quality), detail=detail)
        self.quality = quality
        self.detail = detail

    def status(self) -> dict[str, Any]:
        """Plain data for STATUS; no key for what is not known."""
        found: dict[str, Any] = {
            "quality": str(self.quality),
            "polls": self.polls,
            "ok": self.ok,
            "faults": {str(quality): count for quality, count in self.faults.items() if count},
        }
        if self.detail:
            found["detail"] = self.detail
        if not math.isnan(self.last_ok_s):
            found["last_ok_s"] = self.last_ok_s
        return found
