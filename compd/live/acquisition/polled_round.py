"""A round of polls: every gauge of a line is polled in turn, its readings are published or discarded.

A gauge that does not answer rests for a short time, so that an absent unit does not slow the others on its line, and
for a longer one where it makes them stale. Where replies do not say whose they are, the readings of a round are
published when it has ended and nothing more came (`compd.live.acquisition.reply_order`).

A gateway before a serial bus serves no unit while it waits for one that does not answer, whatever the line's timeout
is. What such a request has cost is known when the next gauge answers. Where that gauge's reading has gone stale
meanwhile, twice in a row, the silent gauge is asked again only after `TIMES_COST` as long. A gauge that costs no other
gauge a reading rests as `PolledGauge` has it.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import structlog

from compd.clock import Clock
from compd.gauge import LineFault, Quality, Reading
from compd.line_settings import PolledLineSettings
from compd.lines import Line, explained, shown
from compd.live.acquisition.polled_gauge import DAMAGED, MAX_REST_S, BackOff, PolledGauge
from compd.live.acquisition.reply_order import ReplyOrder
from compd.live.acquisition.round_trigger import RoundBuffer, send_trigger
from compd.live.memory import PollRequests

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


# Shortest period (s) of polling rounds. Modbus TCP answers in 0.1 ms; polling it without a pause would starve the other
# lines of the interpreter and keep a processor busy.
MIN_ROUND_S = 2e-3
# Stands for the time of a round trigger that could not be sent.
NOT_LATCHED_S = -math.inf
# Faults after which no byte of a reply can follow. After any other fault the line is drained, so that the rest of a
# reply is not taken for the answer to the next request.
NO_REPLY_PENDING = (Quality.LINE_LOST, Quality.DEVICE_ERROR, Quality.SILENT)


class PolledRound:
    """The gauges of one line, polled in turn; used by its thread."""

    def __init__(
        self,
        gauges: Sequence[PolledGauge],
        settings: PolledLineSettings,
        buffer: RoundBuffer | None,
        clock: Clock,
        stop: threading.Event,
        back_off: BackOff,
        poll_requests: PollRequests,
    ) -> None:
        """`buffer`: where the gauges put their readings on a line with a round trigger. `stop`: ends a round early.

        `back_off`: of the line, which every answer ends. `poll_requests`: of clients.
        """
        self.duration_s = math.nan  #: of the last round of polls, s; nan before the first
        self._gauges = gauges
        self._trigger = settings.round_trigger
        self._poll_every_s = settings.poll_every_s
        self._buffer = buffer
        self._clock = clock
        self._stop = stop
        self._back_off = back_off
        self._order = ReplyOrder([gauge.driver for gauge in gauges], settings.timeout_s)
        self._waiting: list[tuple[PolledGauge, Sequence[Reading], float]] = []  # with the time from request to reply, s
        self._dropped_before = 0  # unsolicited bytes at the start of the round
        self._absent = AbsentGauges()
        self._poll_requests = poll_requests
        self._requested = {gauge.name: poll_requests.count(gauge.name) for gauge in gauges}

    def opened(self) -> None:
        """The line has been opened."""
        self._order.opened(self._clock.monotonic())

    def lost(self) -> None:
        """The line is lost: discard the waiting readings and publish the gauges' faults."""
        self._waiting.clear()
        self._publish()

    def take(self, line: Line) -> None:
        """Poll every gauge that is not resting, then wait for the next round. Raises LineFault (LINE_LOST)."""
        start_s = self._clock.monotonic()
        self._dropped_before = line.unexpected_bytes
        self._heed_requests(start_s)
        due = [gauge for gauge in self._gauges if gauge.rests_until_s <= start_s]
        latched_s = self._latch(due, line)
        for gauge in due:
            if latched_s != NOT_LATCHED_S and not self._stop.is_set():
                self._poll(gauge, line, latched_s)
        self._publish_waiting(line)
        self._publish()
        end_s = self._clock.monotonic()
        self.duration_s = end_s - start_s
        next_s = start_s + max(self._poll_every_s, MIN_ROUND_S)
        wake_s = max(next_s, min((gauge.rests_until_s for gauge in self._gauges), default=next_s))
        if wake_s > end_s:
            self._clock.wait(self._stop, wake_s - end_s)

    def _heed_requests(self, now_s: float) -> None:
        """End the rest of every gauge that a client wants polled; a short rest ends by itself."""
        for gauge in self._gauges:
            count = self._poll_requests.count(gauge.name)
            if count != self._requested[gauge.name]:
                self._requested[gauge.name] = count
                if gauge.rests_until_s > now_s + MAX_REST_S:
                    gauge.resume()

    def _publish(self) -> None:
        if self._buffer is not None:
            self._buffer.publish()

    def _latch(self, due: Sequence[PolledGauge], line: Line) -> float | None:
        """Send the round trigger: its time (s); None where the line has none, NOT_LATCHED_S where it failed.

        The gauges of that round have no value then: they would show what they have latched before. Raises LineFault
        (LINE_LOST).
        """
        if self._trigger is None or not due:
            return None
        try:
            return send_trigger(self._trigger, line)
        except LineFault as fault:
            if fault.quality is Quality.LINE_LOST:
                raise
            first, *others = due
            text = f"round trigger: {explained(fault, line).detail}"
            self._fail(first, line, fault.quality, text)
            for gauge in others:
                gauge.fail(fault.quality, text, self._clock.monotonic())
            return NOT_LATCHED_S

    def _poll(self, gauge: PolledGauge, line: Line, latched_s: float | None) -> None:
        start_s = self._clock.monotonic()
        failures = gauge.failures
        with self._faults_of(gauge, line):
            before_s = line.last_request_s
            readings = self._ask(gauge, line, latched_s)
            now_s = self._clock.monotonic()
            self._back_off.succeeded()
            self._absent.answered(gauge, now_s)
            # a device that sends unsolicited readings has no late replies
            asked_s = line.last_request_s
            if asked_s > before_s and self._order.in_doubt(now_s):
                self._waiting.append((gauge, readings, now_s - asked_s))
            else:
                if asked_s > before_s:
                    self._order.answered(now_s - asked_s)
                gauge.put(readings, now_s)
        if gauge.failures > failures:
            self._absent.missed(gauge, start_s)

    def _ask(self, gauge: PolledGauge, line: Line, latched_s: float | None) -> Sequence[Reading]:
        """The gauge's answer; after a missed reply its second one, where `ReplyOrder` wants that."""
        now_s = self._clock.monotonic()
        self._order.asked(now_s)
        if not (gauge.fresh(now_s) and self._order.asks_twice()):
            return gauge.read(line, latched_s)
        gauge.driver.read(line)
        again_s = self._clock.monotonic()
        self._order.asked(again_s)
        readings = gauge.read(line, latched_s)
        self._order.answered_again(self._clock.monotonic() - again_s)
        return readings

    def _publish_waiting(self, line: Line) -> None:
        """Publish the readings that wait, if nothing more comes. Raises LineFault (LINE_LOST)."""
        if not self._waiting:
            return
        # bytes before a request were dropped: the previous reply may belong to another request
        dropped = line.unexpected_bytes - self._dropped_before
        in_step = self._order.in_step
        listen_s = self._order.listen_s(self._clock.monotonic() - line.last_request_s)
        came = line.drain(listen_s)
        if (came or dropped) and not self._order.is_noise(len(came) + dropped):
            seen = shown(came) if came else f"{dropped} bytes"
            self._discard_waiting(f"{seen} came that nobody asked for: replies may belong to other requests")
            self._order.missed(self._clock.monotonic())
            if self._order.asks_twice():
                line.drain(self._order.pause_s())
                return
            longer_s = self._order.listen_s(0.0)
            if listen_s < longer_s:
                line.drain(longer_s)
        self._order.kept_silent()
        waiting, self._waiting = self._waiting, []
        if not in_step:  # a reply may have come late, and another not at all: from the next round on they count
            return
        for gauge, readings, duration_s in waiting:
            with self._faults_of(gauge, line):
                self._order.answered(duration_s)
                gauge.put(readings, self._clock.monotonic())

    def _discard_waiting(self, why: str) -> None:
        """Count the polls of the waiting readings as failed: they may answer other requests."""
        now_s = self._clock.monotonic()
        waiting, self._waiting = self._waiting, []
        for gauge, _, _ in waiting:
            gauge.fail(Quality.MISMATCH, why, now_s)
            gauge.resume()  # the silence has been kept

    @contextmanager
    def _faults_of(self, gauge: PolledGauge, line: Line) -> Iterator[None]:
        """Count what goes wrong with a gauge, and leave the line without anything under way, so far as that can be.

        Raises LineFault (LINE_LOST).
        """
        try:
            yield
        except LineFault as fault:
            if fault.quality is Quality.LINE_LOST:
                raise
            self._fail(gauge, line, fault.quality, explained(fault, line).detail)
        except MemoryError:  # the whole process has run out of them
            raise
        except Exception as error:  # noqa: BLE001  of a driver; it must not end the line's thread
            self._fail(gauge, line, Quality.DRIVER_ERROR, gauge.driver_error(error))

    def _fail(self, gauge: PolledGauge, line: Line, quality: Quality, detail: str) -> None:
        """Raises LineFault (LINE_LOST)."""
        failed_s = self._clock.monotonic()
        if quality in NO_REPLY_PENDING:
            gauge.fail(quality, detail, failed_s)
            return
        # A silence as long as the timeout has been kept already. It is kept once more where nothing else would tell a
        # late reply from the next, but not for a unit that has been absent before: the others would wait for it.
        absent = gauge.failures > 0 and len(self._gauges) > 1
        if quality in DAMAGED:
            line.drain(self._order.rest_s(failed_s - line.last_request_s))
            self._order.damaged(self._clock.monotonic())
            self._discard_waiting(f"does not count: {gauge.name}, in the same round, had {quality} {detail}".rstrip())
        else:
            self._order.missed(failed_s, absent)
            if quality is not Quality.TIMEOUT:
                line.drain()
                self._discard_waiting(f"does not count: {gauge.name}, in the same round, had {quality} {detail}")
            elif not self._order.guarded and not absent:
                line.drain()
        gauge.fail(quality, detail, failed_s)
        if len(self._gauges) == 1 and gauge.fresh(failed_s):
            gauge.resume()  # polled again at once: no gauge waits for it, and a late reply is noticed
