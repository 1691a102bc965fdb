"""The threads that poll the gauges, or listen to them, one per line, and put their readings into `Latest`.

A lost line is closed, and opened again after a waiting time that doubles with every failure. A gauge that does not
answer rests for a shorter time, so that an absent unit does not slow the others on its line, and for a longer one where
it makes them stale (`compd.live.acquisition.absent_gauges`). No line waits for another. Where replies do not say whose
they are, the readings of a round are published when it has ended and nothing more came
(`compd.live.acquisition.reply_order`).
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

import structlog

from compd.clock import Clock
from compd.configuration.lines import LineSettings
from compd.configuration.pushed_lines import PushedLineSettings
from compd.gauge import Gauge, LineFault, Quality, Reading
from compd.lines import open_line
from compd.lines.echo import explained
from compd.lines.modbus_tcp import ModbusTcp
from compd.lines.stream import shown
from compd.live.acquisition.absent_gauges import AbsentGauges
from compd.live.acquisition.peers import Peers
from compd.live.acquisition.polled_gauge import LONGEST_REST_S, BackOff, PolledGauge
from compd.live.acquisition.pushed_round import PushedRound
from compd.live.acquisition.reading_trust import ReadingTrust
from compd.live.acquisition.reply_order import ReplyOrder
from compd.live.acquisition.round_trigger import RoundBuffer, send_trigger
from compd.live.memory.latest import Latest
from compd.live.memory.poll_requests import PollRequests
from compd.live.realtime import sharpen_timers

log = structlog.get_logger()

_NO_TRUST: Mapping[str, ReadingTrust] = {}
# Shortest time from one round of polls to the next, s. Modbus TCP answers in 0.1 ms: polled without a pause, it would
# take the interpreter from the other lines, and a processor from everybody.
FASTEST_ROUND_S = 2e-3
# In place of a round trigger's time, where it could not be sent.
NOT_LATCHED_S = -math.inf
# Faults after which no byte of a reply can follow. After all others the line is drained, or the rest of a reply would
# be taken for the answer to the next request.
NOTHING_UNDER_WAY = (Quality.LINE_LOST, Quality.DEVICE_ERROR, Quality.SILENT)


class OpenLine(Protocol):
    """What acquisition itself needs of a line; the rest is between the line and the driver."""

    @property
    def last_request_s(self) -> float:
        """Monotonic time of the last request, s; -inf before the first, and where a reply names its request."""

    @property
    def unexpected_bytes(self) -> int:
        """Bytes that came without a request, since the line was opened."""

    @property
    def request_came_back(self) -> bool:
        """Whether the first bytes that came after the last request are that request."""

    def drain(self, quiet_s: float | None = None) -> bytes:
        """Wait until nothing has come for `quiet_s`, the line's timeout if None; what came."""

    def close(self) -> None:
        """Close the line."""


# Opens a line from its settings; raises LineFault (LINE_LOST) where it cannot.
Opener = Callable[[Any, Clock], OpenLine]


class LineThread:
    """The thread of one line: opens it, polls its gauges in turn, and opens it again when it is lost.

    Attributes
    ----------
    state, detail : "opening", "open", "lost" or "stopped", and why it is lost.
    opened, lost : how often the line was opened and lost.
    round_s : duration of the last round of polls, s; nan before the first.
    gauges : the line's gauges, with the counts of their polls and faults.
    """

    def __init__(
        self,
        name: str,
        settings: LineSettings,
        gauges: Sequence[tuple[str, Gauge[Any]]],
        stale_after_s: Mapping[str, float],
        latest: Latest,
        clock: Clock,
        opener: Opener = open_line,
        trust: Mapping[str, ReadingTrust] = _NO_TRUST,
        peers: Peers | None = None,
        poll_requests: PollRequests | None = None,
    ) -> None:
        """`gauges`: (name, driver) in the order of polling; `latest` must have their channels as "gauge.channel".

        `stale_after_s`: by gauge, age (s) from which its readings are not used. `trust`: judges the readings of each
        length channel that is wired, by "gauge.channel". `peers`: of the lines beside this one.
        `poll_requests`: of clients.
        """
        self.name = name
        self.state = "opening"
        self.detail = ""
        self.opened = 0
        self.lost = 0
        self.round_s = math.nan
        self._round_buffer = None if settings.round_trigger is None else RoundBuffer(latest)
        self.gauges = [
            PolledGauge(
                gauge, driver, self._round_buffer or latest, settings.timeout_s, stale_after_s[gauge], clock, trust
            )
            for gauge, driver in gauges
        ]
        self._settings = settings
        speaks = isinstance(settings, PushedLineSettings)
        self._pushed = PushedRound(self.gauges, stale_after_s, clock) if speaks else None
        self._poll_every_s = 0.0 if isinstance(settings, PushedLineSettings) else settings.poll_every_s
        self._clock = clock
        self._opener = opener
        self._peers = Peers() if peers is None else peers
        self._trigger = settings.round_trigger
        self._line: Any = None  # an OpenLine; of another kind for each driver
        self._order = ReplyOrder([driver for _, driver in gauges], settings.timeout_s)
        self._waiting: list[tuple[PolledGauge, Sequence[Reading], float]] = []  # with the time from request to reply, s
        self._dropped_before = 0  # bytes that nobody had asked for, at the start of the round
        self._back_off = BackOff(*settings.back_off_s)
        self._absent = AbsentGauges()
        self._poll_requests = PollRequests() if poll_requests is None else poll_requests
        self._requested = {name: self._poll_requests.count(name) for name, _ in gauges}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"line {name}", daemon=True)

    def start(self) -> None:
        """Start to poll; return at once, whether or not the line can be opened."""
        self._thread.start()

    @property
    def thread_id(self) -> int | None:
        """Of the line's thread, as the kernel counts; None before its start."""
        return self._thread.native_id

    def stop(self) -> None:
        """Ask the thread to end, which it does after its current poll."""
        self._stop.set()

    def join(self, timeout_s: float) -> bool:
        """Wait for the thread's end; False if it has not ended within `timeout_s`."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def status(self) -> dict[str, Any]:
        """The line's part of STATUS, as plain data; what is not known is left out."""
        line = self._line
        status: dict[str, Any] = {"state": self.state, "opened": self.opened, "lost": self.lost}
        if self.detail:
            status["detail"] = self.detail
        if not math.isnan(self.round_s):
            status["round_s"] = self.round_s
        if line is not None:
            status["unexpected_bytes"] = line.unexpected_bytes
        status["gauges"] = {gauge.name: gauge.status() for gauge in self.gauges}
        return status

    def _run(self) -> None:
        sharpen_timers()
        while not self._stop.is_set():
            try:
                self._line = self._opener(self._settings, self._clock)
                self._mark_open()
                while not self._stop.is_set():
                    if self._pushed is None:
                        self._round(self._line)
                    elif self._pushed.take(self._line):
                        self._back_off.succeeded()
            except LineFault as fault:  # LINE_LOST alone: `_faults_of` handles every other fault
                self._mark_lost(fault.detail)
            except MemoryError:  # it is the whole process that has none left
                raise
            except Exception as error:  # a port's library may raise anything; it must not end the line's thread
                if self.state != "lost":
                    log.exception("line failed", line=self.name)
                self._mark_lost(f"{type(error).__name__}: {error}")
            finally:
                self._close()
            if not self._stop.is_set():
                self._clock.wait(self._stop, self._back_off.failed())
        self.state = "stopped"

    def _mark_open(self) -> None:
        self.opened += 1
        self.state, self.detail = "open", ""
        log.info("line is open", line=self.name)
        if isinstance(self._line, ModbusTcp):
            self._peers.connected(self.name, self._line.peer)
        self._order.opened(self._clock.monotonic())
        for gauge in self.gauges:
            gauge.resume()

    def _mark_lost(self, detail: str) -> None:
        if self.state != "lost":
            self.lost += 1
            log.warning("line is lost", line=self.name, detail=detail)
        self.state, self.detail = "lost", detail
        self._waiting.clear()
        for gauge in self.gauges:
            gauge.lose(Quality.LINE_LOST, detail, self._clock.monotonic())
        self._publish_round()

    def _close(self) -> None:
        line, self._line = self._line, None
        if line is None:
            return
        self._peers.closed(self.name)
        try:
            line.close()
        except Exception as error:  # noqa: BLE001  of a lost port; it must not end the line's thread
            log.info("a line did not close cleanly", line=self.name, reason=str(error))

    def _round(self, line: OpenLine) -> None:
        """Poll every gauge that is not resting, then wait for the next round. Raises LineFault (LINE_LOST)."""
        start_s = self._clock.monotonic()
        self._dropped_before = line.unexpected_bytes
        self._heed_requests(start_s)
        due = [gauge for gauge in self.gauges if gauge.rests_until_s <= start_s]
        latched_s = self._latch(due, line)
        for gauge in due:
            if latched_s != NOT_LATCHED_S and not self._stop.is_set():
                self._poll(gauge, line, latched_s)
        self._publish_waiting(line)
        self._publish_round()
        end_s = self._clock.monotonic()
        self.round_s = end_s - start_s
        next_s = start_s + max(self._poll_every_s, FASTEST_ROUND_S)
        wake_s = max(next_s, min((gauge.rests_until_s for gauge in self.gauges), default=next_s))
        if wake_s > end_s:
            self._clock.wait(self._stop, wake_s - end_s)

    def _heed_requests(self, now_s: float) -> None:
        """End the rest of every gauge that a client wants to be polled; a short one ends soon by itself."""
        for gauge in self.gauges:
            count = self._poll_requests.count(gauge.name)
            if count != self._requested[gauge.name]:
                self._requested[gauge.name] = count
                if gauge.rests_until_s > now_s + LONGEST_REST_S:
                    gauge.resume()

    def _publish_round(self) -> None:
        if self._round_buffer is not None:
            self._round_buffer.publish()

    def _latch(self, due: Sequence[PolledGauge], line: OpenLine) -> float | None:
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

    def _poll(self, gauge: PolledGauge, line: OpenLine, latched_s: float | None) -> None:
        start_s = self._clock.monotonic()
        failures = gauge.failures
        with self._faults_of(gauge, line):
            before_s = line.last_request_s
            readings = self._ask(gauge, line, latched_s)
            now_s = self._clock.monotonic()
            self._back_off.succeeded()
            self._absent.answered(gauge, now_s)
            # a device that speaks unasked has no late replies
            asked_s = line.last_request_s
            if asked_s > before_s and self._order.in_doubt(now_s):
                self._waiting.append((gauge, readings, now_s - asked_s))
            else:
                if asked_s > before_s:
                    self._order.answered(now_s - asked_s)
                gauge.put(readings, now_s)
        if gauge.failures > failures:
            self._absent.missed(gauge, start_s)

    def _ask(self, gauge: PolledGauge, line: OpenLine, latched_s: float | None) -> Sequence[Reading]:
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

    def _publish_waiting(self, line: OpenLine) -> None:
        """Publish the readings that wait, if nothing more comes. Raises LineFault (LINE_LOST)."""
        if not self._waiting:
            return
        # what came just before a request was dropped: the reply before it may have been another one's
        dropped = line.unexpected_bytes - self._dropped_before
        in_step = self._order.in_step
        listen_s = self._order.listen_s(self._clock.monotonic() - line.last_request_s)
        came = line.drain(listen_s)
        if came or dropped:
            seen = shown(came) if came else f"{dropped} bytes"
            self._discard_waiting(f"{seen} came that nobody asked for: replies may belong to other requests")
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
        """Count the polls whose readings wait as failed: they may be those of other requests."""
        now_s = self._clock.monotonic()
        waiting, self._waiting = self._waiting, []
        self._order.missed(now_s)
        for gauge, _, _ in waiting:
            gauge.fail(Quality.MISMATCH, why, now_s)
            gauge.resume()  # the silence has been kept

    @contextmanager
    def _faults_of(self, gauge: PolledGauge, line: OpenLine) -> Iterator[None]:
        """Count what goes wrong with a gauge, and leave the line without anything under way, so far as that can be.

        Raises LineFault (LINE_LOST).
        """
        try:
            yield
        except LineFault as fault:
            if fault.quality is Quality.LINE_LOST:
                raise
            self._fail(gauge, line, fault.quality, explained(fault, line).detail)
        except MemoryError:  # it is the whole process that has none left
            raise
        except Exception as error:  # noqa: BLE001  of a driver; it must not end the line's thread
            self._fail(gauge, line, Quality.DRIVER_ERROR, gauge.driver_error(error))

    def _fail(self, gauge: PolledGauge, line: OpenLine, quality: Quality, detail: str) -> None:
        """Raises LineFault (LINE_LOST)."""
        failed_s = self._clock.monotonic()
        if quality in NOTHING_UNDER_WAY:
            gauge.fail(quality, detail, failed_s)
            return
        # A silence as long as the timeout has been kept already. It is kept once more where nothing else would tell a
        # late reply from the next, but not for a unit that has been absent before: the others would wait for it.
        absent = gauge.failures > 0 and len(self.gauges) > 1
        self._order.missed(failed_s, absent)
        if quality is not Quality.TIMEOUT:
            line.drain()
            self._discard_waiting(f"does not count: {gauge.name}, in the same round, had {quality} {detail}".rstrip())
        elif not self._order.guarded and not absent:
            line.drain()
        gauge.fail(quality, detail, failed_s)
        if len(self.gauges) == 1 and gauge.fresh(failed_s):
            gauge.resume()  # asked again at once: it delays nobody, and a late reply is noticed


class Acquisition:
    """The threads of all lines of a machine."""

    def __init__(
        self,
        lines: Mapping[str, tuple[LineSettings, Sequence[tuple[str, Gauge[Any]]]]],
        stale_after_s: Mapping[str, float],
        latest: Latest,
        clock: Clock,
        opener: Opener = open_line,
        trust: Mapping[str, ReadingTrust] = _NO_TRUST,
        poll_requests: PollRequests | None = None,
    ) -> None:
        """`lines`: settings of each line and its gauges as (name, driver), by name of the line.

        `stale_after_s`: by gauge, age (s) from which its readings are not used. `trust`, `poll_requests`: as of
        `LineThread`.
        """
        peers = Peers()
        self.lines = {
            name: LineThread(name, settings, gauges, stale_after_s, latest, clock, opener, trust, peers, poll_requests)
            for name, (settings, gauges) in lines.items()
        }

    def start(self) -> None:
        """Start every line's thread; return at once."""
        for line in self.lines.values():
            line.start()

    def stop(self, timeout_s: float = 5.0) -> bool:
        """End every line's thread; False if one was still busy after `timeout_s` (it ends with the program)."""
        for line in self.lines.values():
            line.stop()
        busy = [line.name for line in self.lines.values() if not line.join(timeout_s)]
        if busy:
            log.warning("lines still busy", lines=busy)
        return not busy

    def status(self) -> dict[str, Any]:
        """Each line's part of STATUS, by name: state, how often opened and lost, round time, and each of its gauges."""
        return {name: line.status() for name, line in self.lines.items()}
