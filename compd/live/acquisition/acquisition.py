"""The threads that poll the gauges, or listen to them, one per line, and put their readings into `Latest`.

A lost line is closed, and opened again after a waiting time that doubles with every failure. No line waits for
another.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import structlog

from compd.gauge import Gauge, LineFault, Quality
from compd.line_settings import LineSettings, PolledLineSettings
from compd.lines import Line, Ports, open_line
from compd.live.acquisition.gauge_trust import Judge
from compd.live.acquisition.polled_gauge import BackOff, PolledGauge
from compd.live.acquisition.polled_round import PolledRound
from compd.live.acquisition.pushed_round import PushedRound
from compd.live.acquisition.round_trigger import RoundBuffer
from compd.live.acquisition.shared_endpoints import Peers
from compd.live.memory import Latest, PollRequests
from compd.live.system import System

log = structlog.get_logger()

_NO_TRUST: Mapping[str, Judge] = {}
# Opens a line from its settings; raises LineFault (LINE_LOST) where it cannot.
Opener = Callable[[Any, System, Ports], Line]


class LineThread:
    """The thread of one line: opens it, polls its gauges in turn, and opens it again when it is lost."""

    def __init__(
        self,
        name: str,
        settings: LineSettings,
        gauges: Sequence[tuple[str, Gauge[Any]]],
        stale_after_s: Mapping[str, float],
        latest: Latest,
        system: System,
        opener: Opener = open_line,
        trust: Mapping[str, Judge] = _NO_TRUST,
        peers: Peers | None = None,
        poll_requests: PollRequests | None = None,
    ) -> None:
        """`gauges`: (name, driver) in the order of polling; `latest` must have their channels as "gauge.channel".

        `stale_after_s`: by gauge, age (s) from which its readings are not used. `trust`: judges the readings of each
        channel that is wired, by "gauge.channel". `peers`: of the lines beside this one.
        `poll_requests`: of clients.
        """
        self.name = name
        self.state = "opening"  #: state, detail: "opening", "open", "lost" or "stopped", and why it is lost
        self.detail = ""
        self.opened = 0  #: opened, lost: how often the line was opened and lost
        self.lost = 0
        buffer = None if settings.round_trigger is None else RoundBuffer(latest)
        #: the line's gauges, with the counts of their polls and faults
        self.gauges = [
            PolledGauge(gauge, driver, buffer or latest, settings.timeout_s, stale_after_s[gauge], system, trust)
            for gauge, driver in gauges
        ]
        self._settings = settings
        self._system = system
        self._opener = opener
        self._peers = Peers() if peers is None else peers
        self._line: Any = None  # a Line; of another kind for each driver
        self._back_off = BackOff(*settings.back_off_s)
        self._stop = threading.Event()
        self._round: PolledRound | PushedRound
        if isinstance(settings, PolledLineSettings):
            requests = PollRequests() if poll_requests is None else poll_requests
            self._round = PolledRound(self.gauges, settings, buffer, system, self._stop, self._back_off, requests)
        else:
            self._round = PushedRound(self.gauges, stale_after_s, system, self._back_off)
        self._thread = system.thread(self._run, f"line {name}")

    def start(self) -> None:
        """Start polling and return at once, even if the line cannot be opened yet."""
        self._thread.start()

    @property
    def thread_id(self) -> int | None:
        """Kernel id of the line's thread; None before its start."""
        return self._thread.native_id

    def stop(self) -> None:
        """Ask the thread to end after its current poll."""
        self._stop.set()

    def join(self, timeout_s: float) -> bool:
        """Wait for the thread's end; False if it has not ended within `timeout_s`."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def status(self) -> dict[str, Any]:
        """The line's part of STATUS as plain data, without unknown values."""
        line = self._line
        status: dict[str, Any] = {"state": self.state, "opened": self.opened, "lost": self.lost}
        if self.detail:
            status["detail"] = self.detail
        if not math.isnan(self._round.duration_s):
            status["round_s"] = self._round.duration_s
        if line is not None:
            status["unexpected_bytes"] = line.unexpected_bytes
        status["gauges"] = {gauge.name: gauge.status() for gauge in self.gauges}
        return status

    def _run(self) -> None:
        self._system.privileges.sharpen_timers()
        while not self._stop.is_set():
            try:
                self._line = self._opener(self._settings, self._system, self._system.ports)
                self._mark_open()
                while not self._stop.is_set():
                    self._round.take(self._line)
            except LineFault as fault:  # LINE_LOST alone: a round handles every other fault
                self._mark_lost(fault.detail)
            except MemoryError:  # the whole process has run out of them
                raise
            except Exception as error:  # a port's library may raise anything; the line's thread must go on
                if self.state != "lost":
                    log.exception("line failed", line=self.name)
                self._mark_lost(f"{type(error).__name__}: {error}")
            finally:
                self._close()
            if not self._stop.is_set():
                self._system.wait(self._stop, self._back_off.failed())
        self.state = "stopped"

    def _mark_open(self) -> None:
        self.opened += 1
        self.state, self.detail = "open", ""
        log.info("line is open", line=self.name)
        if (peer := getattr(self._line, "peer", None)) is not None:  # of a line that a gateway may share
            self._peers.connected(self.name, peer)
        self._round.opened()
        for gauge in self.gauges:
            gauge.resume()

    def _mark_lost(self, detail: str) -> None:
        if self.state != "lost":
            self.lost += 1
            log.warning("line is lost", line=self.name, detail=detail)
        self.state, self.detail = "lost", detail
        for gauge in self.gauges:
            gauge.lose(Quality.LINE_LOST, detail, self._system.monotonic())
        self._round.lost()

    def _close(self) -> None:
        line, self._line = self._line, None
        if line is None:
            return
        self._peers.closed(self.name)
        try:
            line.close()
        except Exception as error:  # noqa: BLE001  of a lost port; it must not end the line's thread
            log.info("a line did not close cleanly", line=self.name, reason=str(error))


class Acquisition:
    """The threads of all lines of a machine."""

    def __init__(
        self,
        lines: Mapping[str, tuple[LineSettings, Sequence[tuple[str, Gauge[Any]]]]],
        stale_after_s: Mapping[str, float],
        latest: Latest,
        system: System,
        opener: Opener = open_line,
        trust: Mapping[str, Judge] = _NO_TRUST,
        poll_requests: PollRequests | None = None,
    ) -> None:
        """`lines`: settings of each line and its gauges as (name, driver), by name of the line.

        `stale_after_s`: by gauge, age (s) from which its readings are not used. `trust`, `poll_requests`: as of
        `LineThread`.
        """
        peers = Peers()
        self.lines = {
            name: LineThread(name, settings, gauges, stale_after_s, latest, system, opener, trust, peers, poll_requests)
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
