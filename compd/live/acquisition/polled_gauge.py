"""A gauge as its line's thread sees it: where its readings go, the counts of its polls, when it is asked next."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import structlog

from compd.clock import Clock
from compd.gauge import Gauge, Quality, Reading, bad
from compd.live.acquisition.gauge_trust import GaugeTrust
from compd.live.acquisition.reading_trust import ReadingTrust
from compd.live.memory.latest import LONGEST_DETAIL, Latest

log = structlog.get_logger()

_NO_TRUST: Mapping[str, ReadingTrust] = {}
# How far ahead of now, s, the time of a reading may be: `send` returns when the last bit will have left. One further
# ahead is of another clock.
AHEAD_S = 0.05


class BackOff:
    """Waiting times after failures: `first_s`, then twice as long each time up to `longest_s`; s."""

    def __init__(self, first_s: float, longest_s: float) -> None:
        self._first_s = first_s
        self._longest_s = longest_s
        self._next_s = first_s

    def failed(self) -> float:
        """Count one failure; the time to wait now, s."""
        wait_s = self._next_s
        self._next_s = min(2 * wait_s, self._longest_s)
        return wait_s

    def succeeded(self) -> None:
        """Begin again with the first waiting time."""
        self._next_s = self._first_s


class PolledGauge:
    """One gauge on its line, with its slots in `Latest` and the counts of its polls; used by the line's thread.

    Attributes
    ----------
    polls, ok : how often it was asked, and how often every channel had a value.
    faults : in how many polls a channel or the whole gauge had each quality.
    quality, detail : of the last poll.
    last_ok_s : monotonic time (s) of the last poll in which every channel had a value; nan before.
    rests_until_s : monotonic time (s) before which it is not asked again.
    reported : whether an exception of its driver is in the log already.
    """

    def __init__(
        self,
        name: str,
        driver: Gauge[Any],
        latest: Latest,
        back_off_s: tuple[float, float],
        clock: Clock,
        trust: Mapping[str, ReadingTrust] = _NO_TRUST,
    ) -> None:
        """`trust`: judges the readings of each length channel that is wired, by "gauge.channel"."""
        self.name = name
        self.driver = driver
        self.polls = 0
        self.ok = 0
        self.faults: dict[Quality, int] = dict.fromkeys(
            Quality, 0
        )  # all keys now, since STATUS reads it on another thread
        self.quality = Quality.NEVER_READ
        self.detail = ""
        self.last_ok_s = math.nan
        self.rests_until_s = -math.inf
        self.reported = False
        self._failures = 0
        self._back_off = BackOff(*back_off_s)
        self._latest = latest
        channels = [f"{name}.{channel.name}" for channel in driver.channels]
        self._slots = [latest.index[channel] for channel in channels]
        self._trust = GaugeTrust([trust.get(channel) for channel in channels], clock)

    def read(self, line: Any) -> Sequence[Reading]:
        """Poll the device; twice where a length is not where its last readings lead. Raises what the driver raises."""
        return self._trust.read(lambda: self.driver.read(line))

    def put(self, readings: Sequence[Reading], now_s: float) -> None:
        """Publish the readings of one poll, one per channel in order, and count the poll.

        Raises TypeError or ValueError for readings that cannot be: a defect of the driver. Nothing is published then.
        """
        if len(readings) != len(self._slots):
            raise ValueError(f"{len(readings)} readings for {len(self._slots)} channels")
        faulty = None
        for reading in readings:
            if not reading.time_s <= now_s + AHEAD_S:
                raise ValueError(f"reading of time {reading.time_s}, it is {now_s}")
            if reading.quality is not Quality.OK:
                faulty = reading
            elif not math.isfinite(reading.value):
                raise ValueError(f"{reading.value} given as ok")
        readings = self._trust.judge(readings, now_s)
        faulty = next((reading for reading in reversed(readings) if not reading.ok), None)
        for slot, reading in zip(self._slots, readings, strict=True):
            if reading.quality is not Quality.MISMATCH:
                self._latest.put(slot, reading)
        self.polls += 1
        if faulty is None:
            self.ok += 1
            self.last_ok_s = now_s
        else:
            for quality in {reading.quality for reading in readings} - {Quality.OK}:
                self.faults[quality] += 1
        self._failures = 0
        self._back_off.succeeded()
        self._report(faulty.quality if faulty else Quality.OK, faulty.detail if faulty else "")

    def fail(self, quality: Quality, detail: str, now_s: float) -> None:
        """Count a poll that failed as a whole: every channel takes `quality`.

        After a missing reply, or the second fault in a row, the gauge rests: a late reply has time to come and go, and
        the others on the line are not slowed.
        """
        self.polls += 1
        self.lose(quality, detail, now_s)
        self._failures += 1
        if quality is Quality.TIMEOUT or self._failures > 1:
            self.rests_until_s = now_s + self._back_off.failed()

    def lose(self, quality: Quality, detail: str, now_s: float) -> None:
        """Give every channel `quality`; with LINE_LOST also without a poll."""
        self._trust.fail(quality, now_s)
        for slot in self._slots:
            self._latest.put(slot, bad(now_s, quality, detail))
        self.faults[quality] += 1
        self._report(quality, detail)

    def resume(self) -> None:
        """End a rest, since the line has been opened anew."""
        self.rests_until_s = -math.inf

    def _report(self, quality: Quality, detail: str) -> None:
        """Log a change of quality, except to and from LINE_LOST, which the line logs once for all its gauges."""
        if quality is not self.quality and Quality.LINE_LOST not in (quality, self.quality):
            log_change = log.info if quality is Quality.OK else log.warning
            log_change("gauge", gauge=self.name, quality=str(quality), was=str(self.quality), detail=detail)
        self.quality = quality
        self.detail = detail[:LONGEST_DETAIL]

    def status(self) -> dict[str, Any]:
        """The gauge's part of STATUS, as plain data; what is not known is left out."""
        status: dict[str, Any] = {
            "quality": str(self.quality),
            "polls": self.polls,
            "ok": self.ok,
            "faults": {str(quality): count for quality, count in self.faults.items() if count},
        }
        if self.detail:
            status["detail"] = self.detail
        if not math.isnan(self.last_ok_s):
            status["last_ok_s"] = self.last_ok_s
        return status
