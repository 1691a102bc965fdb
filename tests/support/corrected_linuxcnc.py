"""LinuxCNC on a simulated hexapod, the injector on its gauges, and a daemon that a test may kill."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import numpy as np
import yaml

from compd.demo import Command, run_commands, take_zero
from compd.errors import DaemonError
from controller import LinuxCnc
from motion_log import MotionSample, read_motion_log
from tests.injection.injector import Injector
from tests.support.daemon_process import Daemon
from tests.support.paths import CONFIG
from tests.support.simulated import made_patient
from tests.support.watching import until

HEXAPOD = "hexapod.yaml"
# [COMPD] in config/linuxcnc/hexapod.ini.
CLAMP_MM, SLEW_MM_PER_S, PERIOD_S = 0.2, 0.5, 0.001
# halsampler prints six decimals of two commands, and limit3 may exceed its slew a little where it stops.
ROUNDING_MM = 3e-6
# limit3 can swing about its input for ever, by a few times what it accelerates by in a period: 20 mm/s2 * (1 ms)**2.
SETTLED_MM = 1e-4
# Of a machine that is to be armed when a fault comes.
TRIES = 5
# Between any two places within reach, for as long as a test likes.
ENDLESS = """\
G21 G90 G17 G94 G64 P0.005
o100 repeat [500]
G1 X40 Y0 Z320 F900
G1 X-40 Y30 Z330
G1 X0 Y-45 Z310
o100 endrepeat
M2
"""
TO_ZERO = "G21 G90 G94 G61\nG1 X0 Y0 Z320 A0 B0 C0 F1200\nG4 P0.5\nM2\n"


class CorrectedLinuxCnc:
    """The machine, its daemon and its controller: on, homed at machine zero, not armed. A context manager."""

    def __init__(self, directory: Path, seed: int = 3, speedup: float = 60.0) -> None:
        self.directory = directory
        self._seed, self._speedup = seed, speedup
        self._running = ExitStack()
        self.injector: Injector
        self.daemon: Daemon
        self.controller: LinuxCnc

    def __enter__(self) -> Self:
        with ExitStack() as running:
            self._start(running)
            self._running = running.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._running.close()

    def _start(self, running: ExitStack) -> None:
        options = ["--seed", str(self._seed), "--speedup", str(self._speedup), "--zero-hold", "3600"]
        simulate = ["sim", "run", str(CONFIG / HEXAPOD), "--directory", str(self.directory), *options]
        ready = self.directory / "control.sock"
        running.enter_context(run_commands([Command(simulate, ready)], log=self.directory / "simulate.log"))
        ports = self.directory / "injected"
        ports.mkdir()
        # a pause of the computer disarms nothing; what a test breaks still does
        configuration = yaml.safe_load(made_patient((self.directory / HEXAPOD).read_text()))
        self.injector = running.enter_context(Injector(configuration, ports))
        path = self.directory / "machine.yaml"
        path.write_text(yaml.safe_dump(self.injector.daemon_configuration(), sort_keys=False))
        self.daemon = Daemon(path)
        running.callback(self.daemon.stop)
        self.daemon.__enter__()
        take_zero(self.daemon.socket)
        self.controller = running.enter_context(LinuxCnc(self.directory / "controller", self.directory))
        self.controller.switch_on()
        self._endless = self._program("endless.ngc", ENDLESS)
        self._to_zero = self._program("to_zero.ngc", TO_ZERO)

    def _program(self, name: str, text: str) -> Path:
        path = self.controller.directory / name
        path.write_text(text)
        self.controller.give(path)
        return path

    # --- what a test does -----------------------------------------------------------------------------

    def move_with_corrections(self) -> None:
        """On the move in an endless program, and still armed."""
        for _ in range(TRIES):
            self.controller.ask("abort")
            try:
                self.controller.with_corrections()
            except DaemonError:
                if not self.controller.held_by():
                    raise
                continue  # a setpoint was late again before the corrections had arrived
            self.controller.start(self._endless)
            since_s = self.now_s
            self.until(
                "the machine moves or is held",
                since_s,
                lambda samples: samples if samples and (samples[-1].inhibited or moved_mm(samples) > 1.0) else None,
            )
            if self.controller.value("compd.armed"):
                return
        raise AssertionError(f"the bridge did not stay armed: {self.controller.held_by()}")

    def stop_bridge(self) -> tuple[int, float]:
        """SIGSTOP to the bridge while it is armed; returns its process, and when it was stopped, s."""
        pid = self.bridge_pid()
        for _ in range(TRIES):
            stopped_s = time.monotonic()
            os.kill(pid, signal.SIGSTOP)
            if self.controller.value("compd.armed"):
                return pid, stopped_s
            os.kill(pid, signal.SIGCONT)  # it had been disarmed by a late setpoint
            self.move_with_corrections()
        raise AssertionError(f"the bridge did not stay armed: {self.controller.held_by()}")

    def go_to_zero(self) -> None:
        self.controller.ask("abort")
        self.controller.run(self._to_zero, 60.0)

    def kill_daemon(self) -> None:
        """SIGKILL to all of its processes at once."""
        for pid in self.daemon.left():
            os.kill(pid, signal.SIGKILL)
        self.daemon.stop()

    def restart_daemon(self) -> None:
        self.daemon.__enter__()
        self.controller.give(self.daemon.socket)

    def bridge_pid(self) -> int:
        """Its command line has the path of this daemon's socket."""
        for entry in Path("/proc").iterdir():
            if entry.name.isdecimal():
                try:
                    words = (entry / "cmdline").read_bytes().split(b"\0")
                except OSError:
                    continue  # it has just ended
                if str(self.daemon.socket).encode() in words and any(b"compd_bridge.py" in word for word in words):
                    return int(entry.name)
        raise AssertionError("the bridge does not run")

    # --- what the motors were commanded ---------------------------------------------------------------

    @property
    def now_s(self) -> float:
        """Time of the newest sample."""
        return self.samples()[-1].time_s

    def samples(self, since_s: float = -np.inf) -> list[MotionSample]:
        return read_motion_log(self.controller.motion_log, since_s)

    def until(
        self, what: str, since_s: float, holds: Callable[[list[MotionSample]], list[MotionSample] | None]
    ) -> list[MotionSample]:
        """The samples since a time, as soon as `holds` returns some of them."""
        return until(what, lambda: holds(self.samples(since_s)))

    def inhibited_s(self, since_s: float) -> float:
        """When the feed was first inhibited after `since_s`."""
        inhibited = self.until(
            "the feed is inhibited", since_s, lambda samples: [sample for sample in samples if sample.inhibited]
        )
        return inhibited[0].time_s

    def for_s(self, duration_s: float) -> list[MotionSample]:
        """The samples of so long, from now on."""
        since_s = self.now_s
        return self.until(
            "time passes", since_s, lambda samples: samples if samples[-1].time_s > since_s + duration_s else None
        )


def moved_mm(samples: Sequence[MotionSample]) -> float:
    """How far any link's nominal command has gone."""
    nominal_mm = np.array([sample.nominal_mm for sample in samples])
    return float(np.ptp(nominal_mm, axis=0).max()) if len(samples) else 0.0


def check_corrections(samples: Sequence[MotionSample]) -> None:
    """No correction beyond the clamp, none faster than the slew, and every command a number."""
    assert all(np.isfinite(sample.drive_mm).all() for sample in samples)
    assert max(sample.largest_mm for sample in samples) <= CLAMP_MM + ROUNDING_MM
    assert max(sample.step_mm for sample in samples) <= SLEW_MM_PER_S * PERIOD_S + ROUNDING_MM
