"""The compute loop: wakes at absolute times, runs one cycle, hands its setpoint on."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import structlog

from compd.clock import Clock
from compd.configuration.operation import LoopSettings
from compd.live import realtime
from compd.live.loop.commands import Commands
from compd.live.loop.setpoint import Setpoint
from compd.live.loop.timing import LoopTiming
from compd.live.systemd import Notifier
from compd.readings import Latest, Snapshot

_log = structlog.get_logger()


class Computes(Protocol):
    """One cycle: what it finds from what it is given, nothing else."""

    def run(self, tick: int, snapshot: Snapshot, orders: Commands) -> Setpoint:
        """The setpoint of one tick."""
        ...


class Loop:
    """The loop thread: it alone counts ticks and makes setpoints."""

    def __init__(
        self,
        settings: LoopSettings,
        cycle: Computes,
        latest: Latest,
        orders: Commands,
        outlets: Sequence[Callable[[Setpoint], None]],
        notifier: Notifier,
        clock: Clock,
        sleep_until: Callable[[float], None] = realtime.sleep_until,
    ) -> None:
        """`outlets` take every setpoint and must not wait."""
        self.timing = LoopTiming(1.0 / settings.rate_hz)
        self.permissions: Mapping[str, realtime.Permission] = {}
        self._settings = settings
        self._cycle = cycle
        self._latest = latest
        self._orders = orders
        self._outlets = tuple(outlets)
        self._notifier = notifier
        self._clock = clock
        self._sleep_until = sleep_until
        self._collector = realtime.QuietCollector()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="loop", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """After the cycle that is running; returns when the thread has ended."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join()

    @property
    def alive(self) -> bool:
        """False once the thread has ended, for whatever reason."""
        return self._thread.is_alive()

    def _run(self) -> None:
        self._prepare()
        try:
            self.turn()
        finally:
            self._collector.stop()
            realtime.restore_switch_interval()

    def _prepare(self) -> None:
        """Ask for what real time needs; what is not permitted is said, and the loop runs without."""
        asked = {"sched_fifo": realtime.use_fifo(self._settings.priority)}
        if self._settings.lock_memory:
            asked["locked_memory"] = realtime.lock_memory()
        asked["switch_interval"] = realtime.shorten_switch_interval()
        asked["quiet_collector"] = self._collector.start(self._clock.monotonic())
        for name, permission in asked.items():
            if permission.granted:
                _log.info("granted", what=name, detail=permission.detail)
            else:
                _log.warning("not permitted", what=name, detail=permission.detail)
        self.permissions = asked

    def turn(self) -> None:
        """Cycles until stopped. Tick k belongs to start + k periods; a tick whose time has passed is skipped whole."""
        period_s, clock, timing = self.timing.period_s, self._clock, self.timing
        origin_s = clock.monotonic()
        tick = 1
        while not self._stop.is_set():
            wake_s = origin_s + tick * period_s
            self._sleep_until(wake_s)
            start_s = clock.monotonic()
            timing.started(wake_s, start_s)
            setpoint = self._cycle.run(tick, self._latest.snapshot(start_s), self._orders)
            for outlet in self._outlets:
                outlet(setpoint)
            if timing.cycles == 0:
                self._notifier.ready()
            self._notifier.beat(start_s)
            end_s = clock.monotonic()
            following = max(tick + 1, math.ceil((end_s - origin_s) / period_s))
            timing.finished(start_s, end_s, missed=following - tick - 1)
            tick = following
            self._collector.rest(end_s)
