"""Driver threads, one per line: they poll the line's gauges and put readings into Latest.

A lost line is closed, waits (first `back_off_s`, doubling) and is made anew; a gauge that does not answer
rests in the same way, so that an absent unit does not slow the others on its line. No line waits for another.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import structlog

from compd.clock import Clock
from compd.configuration.lines import LineSettings
from compd.gauge import Gauge, LineFault, Quality
from compd.lines import open_line
from compd.live.acquisition.polled_gauge import BackOff, PolledGauge
from compd.live.realtime import sharpen_timers
from compd.readings import Latest

log = structlog.get_logger()

# A line without pace of its own (Modbus TCP answers in 0.1 ms) would take the interpreter from the loop.
FASTEST_ROUND_S = 2e-3
# After these the device has said all it will say; after all others a rest of the reply may be under way.
NOTHING_UNDER_WAY = (Quality.LINE_LOST, Quality.DEVICE_ERROR, Quality.SILENT)


class OpenLine(Protocol):
    """What acquisition itself asks of a line; the rest is between the line and the driver."""

    @property
    def unexpected_bytes(self) -> int: ...
    def drain(self) -> bytes: ...
    def close(self) -> None: ...


Opener = Callable[[Any, Clock], OpenLine]


class LineThread:
    """One line: opens it, polls its gauges in turn, loses it, opens it again."""

    def __init__(
        self,
        name: str,
        settings: LineSettings,
        gauges: Sequence[tuple[str, Gauge[Any]]],
        latest: Latest,
        clock: Clock,
        opener: Opener = open_line,
    ) -> None:
        """`gauges`: (name, driver) in polling order; their channels must be in `latest`."""
        self.name = name
        self.state = "opening"
        self.detail = ""
        self.opened = 0
        self.lost = 0
        self.round_s = math.nan
        self.gauges = [PolledGauge(gauge, driver, latest, settings.back_off_s) for gauge, driver in gauges]
        self._settings = settings
        self._clock = clock
        self._opener = opener
        self._line: OpenLine | None = None
        self._back_off = BackOff(*settings.back_off_s)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"line {name}", daemon=True)

    def start(self) -> None:
        """Begin to poll; returns at once, also when the line is not there."""
        self._thread.start()

    def stop(self) -> None:
        """Ask the thread to end; it does when its current poll ends."""
        self._stop.set()

    def join(self, timeout_s: float) -> bool:
        """Wait for the thread's end; False if it has not ended within `timeout_s`."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def status(self) -> dict[str, Any]:
        """Plain data for STATUS; no key for what is not known."""
        line = self._line
        found: dict[str, Any] = {"state": self.state, "opened": self.opened, "lost": self.lost}
        if self.detail:
            found["detail"] = self.detail
        if not math.isnan(self.round_s):
            found["round_s"] = self.round_s
        if line is not None:
            found["unexpected_bytes"] = line.unexpected_bytes
        found["gauges"] = {gauge.name: gauge.status() for gauge in self.gauges}
        return found

    def _run(self) -> None:
        sharpen_timers()
        while not self._stop.is_set():
            try:
                self._line = self._opener(self._settings, self._clock)
                self._now_open()
                while not self._stop.is_set():
                    self._round(self._line)
            except LineFault as fault:  # LINE_LOST: polls name every other fault themselves
                self._now_lost(fault)
            finally:
                if self._line is not None:
                    self._line.close()
                    self._line = None
            if not self._stop.is_set():
                self._clock.wait(self._stop, self._back_off.failed())
        self.state = "stopped"

    def _now_open(self) -> None:
        self.opened += 1
        self.state, self.detail = "open", ""
        log.info("line is open", line=self.name)
        for gauge in self.gauges:
            gauge.awake()

    def _now_lost(self, fault: LineFault) -> None:
        if self.state != "lost":
            self.lost += 1
            log.warning("line is lost", line=self.name, detail=fault.detail)
        self.state, self.detail = "lost", fault.detail
        for gauge in self.gauges:
            gauge.lose(Quality.LINE_LOST, fault.detail, self._clock.monotonic())

    def _round(self, line: OpenLine) -> None:
        """Poll every gauge that does not rest, then wait for the next round. Raises LineFault: LINE_LOST."""
        start_s = self._clock.monotonic()
        for gauge in self.gauges:
            if gauge.rests_until_s <= start_s and not self._stop.is_set():
                self._poll(gauge, line)
        end_s = self._clock.monotonic()
        self.round_s = end_s - start_s
        next_s = start_s + max(self._settings.poll_every_s, FASTEST_ROUND_S)
        wake_s = max(next_s, min((gauge.rests_until_s for gauge in self.gauges), default=next_s))
        if wake_s > end_s:
            self._clock.wait(self._stop, wake_s - end_s)

    def _poll(self, gauge: PolledGauge, line: OpenLine) -> None:
        try:
            gauge.put(gauge.driver.read(line), self._clock.monotonic())
            self._back_off.succeeded()
        except LineFault as fault:
            if fault.quality is Quality.LINE_LOST:
                raise
            if fault.quality not in NOTHING_UNDER_WAY:
                line.drain()
            gauge.fail(fault.quality, fault.detail, self._clock.monotonic())
        except Exception as error:  # a driver is anybody's code: whatever it raises must not end the line's thread
            if not gauge.reported:
                gauge.reported = True
                log.exception("driver failed", gauge=gauge.name)
            line.drain()
            gauge.fail(Quality.DRIVER_ERROR, f"{type(error).__name__}: {error}", self._clock.monotonic())


class Acquisition:
    """All lines of a machine."""

    def __init__(
        self,
        lines: Mapping[str, tuple[LineSettings, Sequence[tuple[str, Gauge[Any]]]]],
        latest: Latest,
        clock: Clock,
        opener: Opener = open_line,
    ) -> None:
        """`lines`: name -> (settings, the line's gauges as (name, driver)); `latest` has every "gauge.channel"."""
        self.lines = {
            name: LineThread(name, settings, gauges, latest, clock, opener)
            for name, (settings, gauges) in lines.items()
        }

    def start(self) -> None:
        """Start every line; none waits for another, or for its device."""
        for line in self.lines.values():
            line.start()

    def stop(self, timeout_s: float = 5.0) -> bool:
        """End every line; False if one was still busy after `timeout_s` (its thread ends with the program)."""
        for line in self.lines.values():
            line.stop()
        busy = [line.name for line in self.lines.values() if not line.join(timeout_s)]
        if busy:
            log.warning("lines still busy", lines=busy)
        return not busy

    def status(self) -> dict[str, Any]:
        """Per line: state, how often opened and lost, round time, and per gauge its polls and faults."""
        return {name: line.status() for name, line in self.lines.items()}
