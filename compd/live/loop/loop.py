"""The compute loop: a thread that wakes at absolute times, runs one cycle and hands the setpoint to its sinks."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence

import structlog

from compd.clock import Clock
from compd.live import realtime
from compd.live.loop.commands import Commands
from compd.live.loop.cycle import step
from compd.live.loop.cycle_state import CycleInputs, CycleSettings, CycleState
from compd.live.loop.setpoint import Setpoint
from compd.live.loop.timing import LoopTiming
from compd.live.systemd import Notifier
from compd.readings import Latest

_log = structlog.get_logger()


class Loop:
    """The loop thread. It alone counts ticks, holds the state of the cycle and makes setpoints."""

    def __init__(
        self,
        cycle: CycleSettings,
        latest: Latest,
        commands: Commands,
        sinks: Sequence[Callable[[Setpoint], None]],
        notifier: Notifier,
        clock: Clock,
        sleep_until: Callable[[float], None] = realtime.sleep_until,
    ) -> None:
        """`sinks` take every setpoint, and must not wait."""
        self.timing = LoopTiming(cycle.period_s)
        self.permissions: Mapping[str, realtime.Permission] = {}
        self._cycle = cycle
        self._state = CycleState.at_start(cycle.model)
        self._latest = latest
        self._commands = commands
        self._sinks = tuple(sinks)
        self._notifier = notifier
        self._clock = clock
        self._sleep_until = sleep_until
        self._collector = realtime.QuietCollector()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run_thread, name="loop", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop after the cycle that is running; returns when the thread has ended."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join()

    @property
    def alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    def _run_thread(self) -> None:
        self._prepare()
        try:
            self.run()
        finally:
            self._collector.stop()
            realtime.restore_switch_interval()

    def _prepare(self) -> None:
        """Ask the system for what real time needs. What it does not permit is logged, and the loop runs without it."""
        settings = self._cycle.loop
        permissions = {"sched_fifo": realtime.use_fifo(settings.priority)}
        if settings.lock_memory:
            permissions["locked_memory"] = realtime.lock_memory()
        permissions["switch_interval"] = realtime.shorten_switch_interval()
        permissions["quiet_collector"] = self._collector.start(self._clock.monotonic())
        for name, permission in permissions.items():
            if permission.granted:
                _log.info("granted", what=name, detail=permission.detail)
            else:
                _log.warning("not permitted", what=name, detail=permission.detail)
        self.permissions = permissions

    def run(self) -> None:
        """Run cycles until stopped. Tick k belongs to start + k periods; a tick whose time has passed is skipped."""
        cycle, commands, clock, timing = self._cycle, self._commands, self._clock, self.timing
        period_s = timing.period_s
        origin_s = clock.monotonic()
        tick = 1
        while not self._stop.is_set():
            wake_s = origin_s + tick * period_s
            self._sleep_until(wake_s)
            start_s = clock.monotonic()
            timing.note_start(wake_s, start_s)
            # the commands are read once: whoever writes them does not wait for the cycle
            snapshot = self._latest.snapshot(start_s)
            inputs = CycleInputs(tick, snapshot, commands.zero, commands.target, commands.models)
            setpoint, self._state = step(self._state, inputs, cycle)
            for sink in self._sinks:
                sink(setpoint)
            if timing.cycles == 0:
                self._notifier.ready()
            self._notifier.beat(start_s)
            end_s = clock.monotonic()
            next_tick = max(tick + 1, math.ceil((end_s - origin_s) / period_s))
            timing.note_end(start_s, end_s, missed=next_tick - tick - 1)
            tick = next_tick
            self._collector.collect_if_due(end_s)
