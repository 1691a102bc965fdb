"""One gauge on its line: the slots of its readings, the counts of its polls, the time of its next poll."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import structlog

from compd.clock import Clock
from compd.gauge import Gauge, Quality, Reading, bad
from compd.live.acquisition.gauge_trust import GaugeTrust, Judge
from compd.live.acquisition.round_trigger import RoundBuffer, stamped
from compd.live.memory import MAX_DETAIL, Latest
from compd.pushed_gauge import Heard
from compd.reading import is_reading

log = structlog.get_logger()

_NO_TRUST: Mapping[str, Judge] = {}
# Faults of the wire. The next poll is likely to succeed, and the last good reading stays valid.
TRANSIENT_FAULTS = (Quality.TIMEOUT, Quality.INCOMPLETE, Quality.CRC, Quality.MISMATCH)
# Failures in a row, above which the cause is more than interference, and the gauge rests between two polls.
MAX_FAILURES = 10
DAMAGED = (Quality.INCOMPLETE, Quality.CRC, Quality.MISMATCH)
# Longest rest (s) of a gauge on an open line: it is polled again within a second of a fault.
MAX_REST_S = 0.9
# Largest lead (s) of a reading's time over now: `send` returns before its last bit has left. A larger lead comes from
# another clock.
MAX_CLOCK_AHEAD_S = 0.05


class BackOff:
    """Waiting times (s) after failures: `first_s`, then doubled each time up to `longest_s`."""

    def __init__(self, first_s: float, longest_s: float) -> None:
        self._first_s = first_s
        self._longest_s = longest_s
        self._next_s = first_s

    def failed(self) -> float:
        """Count one failure; return the time to wait (s)."""
        wait_s = self._next_s
        self._next_s = min(2 * wait_s, self._longest_s)
        return wait_s

    def succeeded(self) -> None:
        """Begin again with the first waiting time."""
        self._next_s = self._first_s


class PolledGauge:
    """One gauge on its line with its slots in `Latest` and its poll counts; used by the line's thread."""

    def __init__(
        self,
        name: str,
        driver: Gauge[Any],
        latest: Latest | RoundBuffer,
        timeout_s: float,
        stale_after_s: float,
        clock: Clock,
        trust: Mapping[str, Judge] = _NO_TRUST,
    ) -> None:
        """`timeout_s`: of the line; `stale_after_s`: age (s) from which a reading is not used; `trust`: judges the
        readings of each channel that is wired, by "gauge.channel"."""
        self.name = name
        self.driver = driver
        #: polls, ok: how often it was asked, but for answers that were thrown away; how often every channel had a value
        self.polls = 0
        self.ok = 0
        #: in how many polls a channel or the whole gauge had each quality
        self.faults: dict[Quality, int] = dict.fromkeys(
            Quality, 0
        )  # all keys from the start, since STATUS reads it on another thread
        self.quality = Quality.NEVER_READ  #: quality, detail: of the last poll
        self.detail = ""
        self.last_ok_s = math.nan  #: monotonic time (s) of the last poll in which every channel had a value; nan before
        self.rests_until_s = -math.inf  #: monotonic time (s) before which it is not asked again
        self.reported = False  #: whether an exception of its driver is in the log already
        self.failures = 0  #: polls that failed as a whole, in a row
        self._back_off = BackOff(min(timeout_s, MAX_REST_S), MAX_REST_S)
        self._stale_after_s = stale_after_s
        self._latest = latest
        channels = [f"{name}.{channel.name}" for channel in driver.channels]
        self._slots = [latest.index[channel] for channel in channels]
        self._trust = GaugeTrust([trust.get(channel) for channel in channels], clock)
        self._published = [bad(-math.inf, Quality.NEVER_READ)] * len(self._slots)
        self._received = list(self._published)  # the newest reading of each channel, for unsolicited ones
        self._logged = Quality.NEVER_READ

    def read(self, line: Any, latched_s: float | None = None) -> Sequence[Reading]:
        """Poll the device; poll again if a value is outside its predicted range. Raises the driver's exceptions.

        latched_s : when the round trigger has latched it, monotonic time (s); None without one.
        """
        return self._trust.read(lambda: stamped(self.driver.read(line), latched_s))

    def put(self, readings: Sequence[Reading], now_s: float) -> None:
        """Publish the readings of one poll, one per channel in order, and count the poll.

        Raises TypeError or ValueError for readings that cannot be: a defect of the driver. Nothing is published then.
        """
        if len(readings) != len(self._slots):
            raise ValueError(f"{len(readings)} readings for {len(self._slots)} channels")
        for reading in readings:
            _check(reading, now_s)
        readings = self._trust.judge(readings, now_s)
        for index, reading in enumerate(readings):
            self._publish_unless_kept(index, reading, now_s)
        self._count(readings, readings, now_s)

    def receive(self, received: Sequence[Heard], now_s: float) -> None:
        """Publish unsolicited readings of some channels, and count them as a poll.

        A value that is too old to be used when it comes is stale. Raises ValueError as `put` does.
        """
        if not received:
            return
        for each in received:
            _check(each.reading, now_s)
        judged = []
        for each in received:
            reading = self._trust.receive(each.channel_index, self._if_young(each.reading, now_s), each.window_s, now_s)
            self._received[each.channel_index] = reading
            self._publish_unless_kept(each.channel_index, reading, now_s)
            judged.append(reading)
        self._count(judged, self._received, now_s)

    def _if_young(self, reading: Reading, now_s: float) -> Reading:
        age_s = now_s - reading.time_s
        if not reading.ok or age_s <= self._stale_after_s:
            return reading
        return bad(reading.time_s, Quality.STALE, f"measured {age_s:.3g} s ago by the clock of its source")

    def _count(self, readings: Sequence[Reading], all_readings: Sequence[Reading], now_s: float) -> None:
        """Count a poll that gave `readings`; `all_readings` are the newest of all channels."""
        faulty = next((reading for reading in reversed(all_readings) if not reading.ok), None)
        self.polls += 1
        if faulty is None:
            self.ok += 1
            self.last_ok_s = now_s
        for quality in {reading.quality for reading in readings} - {Quality.OK}:
            self.faults[quality] += 1
        self.failures = 0
        self._back_off.succeeded()
        self._note(faulty.quality if faulty else Quality.OK, faulty.detail if faulty else "")
        self._log_change()

    def fail(self, quality: Quality, detail: str, now_s: float) -> None:
        """Count a poll that failed as a whole, at the monotonic time `now_s` (s).

        A reading that is still good stays after a fault that may pass (`TRANSIENT_FAULTS`); every other channel takes
        `quality`. After more than MAX_FAILURES in a row the gauge rests for one timeout of the line, then for twice as
        long each time: the others are not slowed.
        """
        self.polls += 1
        self.faults[quality] += 1
        self._trust.fail(quality, now_s)
        published = bad(now_s, quality, detail)
        kept = sum(self._publish_unless_kept(index, published, now_s) for index in range(len(self._slots)))
        self._note(quality, detail)
        if not kept:
            self._log_change()
        self.failures += 1
        if self.failures > MAX_FAILURES:
            self.rests_until_s = now_s + self._back_off.failed()

    def driver_error(self, error: Exception) -> str:
        """The detail of an exception that its driver has raised, which is logged with its traceback the first time."""
        if not self.reported:
            self.reported = True
            log.error("driver failed", gauge=self.name, exc_info=error)
        return f"{type(error).__name__}: {error}"

    def lose(self, quality: Quality, detail: str, now_s: float) -> None:
        """Give every channel `quality` without a poll, for a lost line."""
        self._trust.fail(quality, now_s)
        self.faults[quality] += 1
        for index in range(len(self._slots)):
            self._received[index] = bad(now_s, quality, detail)
            self._publish(index, self._received[index])
        self._note(quality, detail)
        self._log_change()

    def fresh(self, now_s: float) -> bool:
        """Whether any published value may still be used at the monotonic time `now_s` (s)."""
        return any(self._is_fresh(reading, now_s) for reading in self._published)

    def resume(self) -> None:
        """End a rest."""
        self.rests_until_s = -math.inf

    def _publish_unless_kept(self, index: int, reading: Reading, now_s: float) -> bool:
        """Publish a reading; keep a good last reading through a transient fault. Returns whether it was kept."""
        last = self._published[index]
        if reading.quality in TRANSIENT_FAULTS and self._is_fresh(last, now_s):
            return True
        self._publish(index, reading)
        return False

    def _is_fresh(self, reading: Reading, now_s: float) -> bool:
        return reading.ok and now_s - reading.time_s <= self._stale_after_s

    def _publish(self, index: int, reading: Reading) -> None:
        self._published[index] = reading
        self._latest.put(self._slots[index], reading)

    def _note(self, quality: Quality, detail: str) -> None:
        self.quality = quality
        self.detail = detail[:MAX_DETAIL]

    def _log_change(self) -> None:
        """Log a change of quality, except to and from LINE_LOST, which the line logs once for all its gauges."""
        quality, was, self._logged = self.quality, self._logged, self.quality
        if quality is not was and Quality.LINE_LOST not in (quality, was):
            log_change = log.info if quality is Quality.OK else log.warning
            log_change("gauge", gauge=self.name, quality=str(quality), was=str(was), detail=self.detail)

    def status(self) -> dict[str, Any]:
        """The gauge's part of STATUS as plain data, without unknown values."""
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


def _check(reading: Reading, now_s: float) -> None:
    """Raises ValueError for an impossible reading, which is a defect of the driver."""
    if not reading.time_s <= now_s + MAX_CLOCK_AHEAD_S:
        raise ValueError(f"reading of time {reading.time_s}, it is {now_s}")
    if reading.ok and not is_reading(reading.value):
        raise ValueError(f"{reading.value} given as ok")
