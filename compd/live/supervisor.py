"""The supervisor: forks the daemon's processes, starts those anew that have ended or hang, and heeds signals.

It has one thread and computes nothing, so that little can go wrong in it, and a fork takes milliseconds.
"""

from __future__ import annotations

import math
import os
import selectors
import signal
from collections.abc import Callable
from contextlib import suppress
from enum import Enum, auto
from typing import Any

import structlog

from compd.live.daemon import Daemon
from compd.live.loop_succession import LoopSuccession
from compd.live.memory import Phase
from compd.live.processes import Heartbeat, ModelChange, RestartDelay
from compd.live.system import SIGNALS, ChildProcess, Notifier, System

# Between two looks at the beats of the processes.
LOOK_EVERY_S = 0.1
# Looks without a beat after which a process is killed, since it hangs: half a second, and two.
_LOOP_LOOKS, _SERVICE_LOOKS, _ACQUISITION_LOOKS = 5, 20, 20
# How long the correction is held for the clients to see, and how long everything may then take to end.
_HOLD_S = 0.2
_END_WITHIN_S = 1.0

_log = structlog.get_logger()


class Ending(Enum):
    """Why a supervisor has returned."""

    STOPPED = auto()
    RELOADED = auto()
    FAILED = auto()


class Supervisor:
    """Supervises the processes of one daemon."""

    def __init__(self, daemon: Daemon, notifier: Notifier, system: System) -> None:
        self._daemon = daemon
        self._control = daemon.control
        self._notifier = notifier
        self._system = system
        self._loops = LoopSuccession(daemon.loop_process, system, daemon.log_pipe("loop"))
        self._acquisition = {
            process.name: ChildProcess(
                process.name, process.run, system, daemon.log_pipe(process.name), keeps_sockets=False
            )
            for process in daemon.acquisition
        }
        self._service = ChildProcess("service", daemon.service.run, system)
        loop_looks = max(_LOOP_LOOKS, math.ceil(_LOOP_LOOKS * daemon.period_s / LOOK_EVERY_S))
        self._loop_heart = Heartbeat(loop_looks)
        self._service_heart = Heartbeat(_SERVICE_LOOKS)
        self._acquisition_hearts = {name: Heartbeat(_ACQUISITION_LOOKS) for name in self._acquisition}
        self._loop_delay = RestartDelay()
        self._acquisition_delays = {name: RestartDelay() for name in self._acquisition}
        self._request = 0
        self._headline: str | None = None
        self._ready = False

    def run(self, check: Callable[[], None], reload: Callable[[], bool]) -> Ending:
        """Start everything, and supervise until a signal, or the end of the service, ends it.

        check : called at SIGHUP in a process of its own, since code of a driver's author runs there; raises where the
            configuration cannot be used. reload : called when it could; whether the daemon is to end for it.
        """
        self._check = ChildProcess("check", check, self._system, keeps_sockets=True)
        with self._system.signals() as signals:
            for child in self._acquisition.values():
                child.start()
            self._loops.start()
            self._tell()  # before anybody can ask
            self._service.start()
            self._tell()
            try:
                return self._supervise(signals, reload)
            finally:
                self._kill_all()

    def _supervise(self, signals: int, reload: Callable[[], bool]) -> Ending:
        next_look_s = self._system.monotonic()
        while True:
            self._wait(signals, next_look_s)
            for number in _received(signals):
                name = signal.Signals(number).name
                if number != signal.SIGHUP:
                    _log.info("stopping", signal=name)
                    self._notifier.stopping()
                    self._end(f"compd is stopping ({name})")
                    return Ending.STOPPED
                if not self._check.running:
                    self._check.start()
            if self._check.running and self._check.collect() and self._is_good(reload):
                self._notifier.reloading(self._system.monotonic())
                self._end("compd starts anew with another configuration")
                return Ending.RELOADED
            self._collect()
            if not self._service.running:
                _log.error("the service has ended, and with it the daemon", how=self._service.last_end)
                return Ending.FAILED
            self._pass_on()
            now_s = self._system.monotonic()
            if now_s >= next_look_s:
                next_look_s = now_s + LOOK_EVERY_S
                self._look(now_s)
            self._restart(now_s)

    def _wait(self, signals: int, until_s: float) -> None:
        """Until a signal, the end of a process, a wish of the service, a restart that is due, or `until_s`."""
        delays = [self._loop_delay, *self._acquisition_delays.values()]
        due_s = min([until_s, *(delay.due_s for delay in delays)])
        with self._system.selector() as selector:
            for descriptor in (signals, self._control.supervisor_woken, *(child.pidfd for child in self._running())):
                selector.register(descriptor, selectors.EVENT_READ)
            selector.select(max(due_s - self._system.monotonic(), 0.0))

    def _running(self) -> list[ChildProcess]:
        children = [*self._loops.children, self._service, *self._acquisition.values(), self._check]
        return [child for child in children if child.running]

    def _is_good(self, reload: Callable[[], bool]) -> bool:
        """Whether the configuration that has been checked can be used."""
        if not self._check.succeeded:
            _log.error("the configuration is refused, the daemon goes on with its own", check=self._check.last_end)
            return False
        return reload()

    def _collect(self) -> None:
        """Note which processes have ended, and when they are to be started anew."""
        now_s = self._system.monotonic()
        self._service.collect()
        if self._loops.collect(self._request):
            self._loop_delay.ended(self._loops.loop.started_s, now_s)
            how = f"{self._loops.loop.last_end}; it starts anew"
            self._control.loop_fault.write((now_s, f"the loop has ended: {how}"))
            _log.error("the loop has ended", how=how)
            self._tell()
        for name, child in self._acquisition.items():
            if child.running and child.collect():
                self._acquisition_delays[name].ended(child.started_s, now_s)
                _log.error("a process has ended and starts anew", process=name, how=child.last_end)
                self._tell()

    def _restart(self, now_s: float) -> None:
        """Start what has ended and is due."""
        if self._loop_delay.take(now_s):
            # a state with which the loop has ended twice is not given to it a third time
            self._loops.start(forget=self._loop_delay.failures > 1)
            self._loop_heart.reset()
            self._tell()
        for name, child in self._acquisition.items():
            if self._acquisition_delays[name].take(now_s):
                child.start()
                self._acquisition_hearts[name].reset()
                self._tell()

    def _look(self, now_s: float) -> None:
        """Feed the watchdog from the loop's own beat, and kill what hangs."""
        daemon = self._daemon
        if self._loop_heart.look(daemon.setpoints.count):
            self._notifier.beat(now_s)
        self._loops.end_late_successor(now_s)
        self._service_heart.look(self._control.service_beats)
        hearts = [(self._loop_heart, self._loops.loop), (self._service_heart, self._service)]
        for process in daemon.acquisition:
            heart = self._acquisition_hearts[process.name]
            heart.look(process.beats)
            hearts.append((heart, self._acquisition[process.name]))
        for heart, child in hearts:
            if heart.is_late and child.running and child.is_debugged:
                heart.excuse()
            elif heart.hangs and child.running:
                child.kill("it hung, and was killed")
        self._tell()

    def _pass_on(self) -> None:
        """The first cycle and the machine's state go to the service manager, a wish for another model to a new loop."""
        control = self._control
        with suppress(BlockingIOError):
            os.eventfd_read(control.supervisor_woken)
        if not self._ready and self._daemon.setpoints.count:
            self._ready = True
            self._notifier.ready()
        if (headline := control.headline.read()) != self._headline:
            self._headline = headline
            self._notifier.status(headline)
        request = control.model_request.read()
        if request is not None and request[0] != self._request and not self._loops.has_successor:
            self._request = request[0]
            self._loops.start_successor(ModelChange(*request))
        if self._loops.turn_has_changed():
            self._tell()

    def _tell(self) -> None:
        """Write what STATUS tells about the processes."""
        children = {
            "loop": self._loops.loop,
            **self._acquisition,
            "service": self._service,
        }
        processes: dict[str, dict[str, Any]] = {"supervisor": {"pid": os.getpid(), "starts": 1}}
        for name, child in children.items():
            processes[name] = {"pid": child.pid, "starts": child.starts}
            if child.last_end:
                processes[name]["last_end"] = child.last_end
        processes["loop"] |= self._loops.summary()
        self._control.processes.write(processes)

    def _end(self, reason: str) -> None:
        """Let the loop hold the correction, then everything end; whatever has not ended in time is killed."""
        self._control.enter(Phase.HOLDING, reason)
        hold_s = max(_HOLD_S, 2 * self._daemon.period_s)
        self._wait_for_ends(hold_s)
        self._control.enter(Phase.STOPPING, reason)
        self._daemon.setpoints.wake_reader()
        self._wait_for_ends(_END_WITHIN_S)

    def _wait_for_ends(self, within_s: float) -> None:
        """Until all processes have ended, or `within_s` seconds have passed."""
        end_s = self._system.monotonic() + within_s
        while (running := self._running()) and (left_s := end_s - self._system.monotonic()) > 0:
            with self._system.selector() as selector:
                for child in running:
                    selector.register(child.pidfd, selectors.EVENT_READ)
                selector.select(left_s)
            for child in running:
                child.collect()

    def _kill_all(self) -> None:
        for child in self._running():
            _log.warning("a process had to be killed", process=child.name)
            child.kill("it had to be killed at the end")
        for child in self._running():
            child.wait()


def _received(signals: int) -> list[int]:
    try:
        return [number for number in os.read(signals, 64) if number in SIGNALS]
    except BlockingIOError:
        return []
