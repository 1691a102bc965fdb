"""The compute loop: it wakes at absolute times, runs one cycle and hands the setpoint to its sinks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from compd.live.loop.commands import Commands
from compd.live.loop.cycle import step
from compd.live.loop.cycle_state import CycleInputs, CycleSettings, CycleState
from compd.live.loop.setpoint import Setpoint
from compd.live.loop.timing import LoopTiming
from compd.live.memory import Latest
from compd.live.system import System


class Loop:
    """The loop of one machine. It alone counts ticks, holds the state of the cycle and makes setpoints."""

    def __init__(
        self,
        cycle: CycleSettings,
        latest: Latest,
        commands: Commands,
        sinks: Sequence[Callable[[Setpoint], None]],
        system: System,
        timing: LoopTiming | None = None,
    ) -> None:
        """`sinks` take every setpoint, and must not wait. `timing`: where the loops of other processes go on."""
        self.timing = timing or LoopTiming(cycle.period_s)
        self.collector = system.privileges.quiet_collector()
        self._cycle = cycle
        self._latest = latest
        self._commands = commands
        self._sinks = tuple(sinks)
        self._system = system

    def run(
        self, keep_on: Callable[[], bool], ending: Callable[[], str] = lambda: "", state: CycleState | None = None
    ) -> None:
        """Run cycles as long as `keep_on`, which is asked after each of them.

        Tick k belongs to the origin of the timing's grid + k periods; a tick whose time has passed is skipped.

        Parameters
        ----------
        ending : why the correction is to be held, or "".
        state : what the last cycle left; None before the first one.
        """
        cycle, commands, system, timing = self._cycle, self._commands, self._system, self.timing
        period_s = timing.period_s
        state = state or CycleState.at_start(cycle.model)
        tick = timing.begin(system.monotonic())
        origin_s = timing.origin_s
        while keep_on():
            wake_s = origin_s + tick * period_s
            system.sleep_until(wake_s)
            start_s = system.monotonic()
            if late := int((start_s - wake_s) / period_s):  # this process was stopped, or the machine was
                timing.note_missed(late)
                tick += late
            timing.note_start(wake_s, start_s)
            # the commands are read once: whoever writes them does not wait for the cycle
            snapshot = self._latest.snapshot(start_s)
            inputs = CycleInputs(tick, snapshot, commands.zero, commands.target, commands.models, ending())
            setpoint, state = step(state, inputs, cycle)
            for sink in self._sinks:
                sink(setpoint)
            end_s = system.monotonic()
            next_tick = max(tick + 1, math.ceil((end_s - origin_s) / period_s))
            timing.note_end(tick, start_s, end_s, missed=next_tick - tick - 1)
            tick = next_tick
            self.collector.collect_if_due(end_s)
