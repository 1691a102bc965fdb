"""A simulated machine with a hidden cause, the daemon on its wires and a laser tracker, run by `compd` commands alone.

Does what a user would do by hand: drive, load the tip, measure with the tracker, call the commands. Nothing here
knows what is hidden.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from compd.client import connect
from compd.demo.machine_zero import wait_for_gauges
from compd.demo.processes import Command, run_commands
from compd.demo.session import ARRIVED_MM
from compd.documents import read_document
from compd.simulation import ControlClient
from tests.support.hidden_visits import Visit
from tests.support.pose_controller import PoseController
from tests.support.simulated import TRIPOD

# Half the tracker's rate, so that every row has tracker points of its own.
RECORDER_HZ = 10.0
TRACKER_SIGMA_UM = 0.15
# Slower than shipped, to save a third of the processor time; still fast against the frame's motion.
LOOP_HZ, POLL_EVERY_S = 100, 0.02
# Twice what the slowest gauge needs to be read anew and the tracker to measure three times.
DWELL_S = 0.8
# The frame drifts by up to 0.5 um/s at the speed-up of these runs: an older reading is by 0.1 um of another time.
FRESH_S = 0.2
COMMAND_TIMEOUT_S = 300.0
ZERO_TRIES = 3
MORE_CHANNELS = ("force_x_N", "force_y_N", "force_z_N", "pressure_hPa", "humidity_pct")


def write_configuration(directory: Path) -> Path:
    """The shipped tripod with a load cell, a barometer and a hygrometer on its cabinet's module."""
    data = read_document(TRIPOD).data
    address = 16
    for name in MORE_CHANNELS:
        unit = name.rpartition("_")[2]
        data["gauges"]["cabinet"]["channels"].append(
            {"name": name.lower(), "function": 4, "address": address, "type": "float32", "unit": unit}
        )
        data["wiring"]["quantities"].append({"name": name, "gauge": f"cabinet.{name.lower()}"})
        address += 2
    return write_unhurried(directory / TRIPOD.name, data)


def write_unhurried(path: Path, data: dict[str, Any]) -> Path:
    """A configuration for one of several machines side by side on one computer: its own Unix socket, no hurry."""
    del data["sockets"]["tcp"]
    data["loop"]["rate_hz"] = LOOP_HZ
    for line in data["lines"].values():
        line.setdefault("poll_every_s", POLL_EVERY_S)
    # their devices stand still with the computer, and count on after it
    for gauge in data["gauges"].values():
        gauge["trust_after_loss"] = True
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return path


@dataclass
class HiddenRun:
    """A machine that runs, seen from outside.

    configuration: as a person wrote it; directory: of the simulation; machine: its controller.
    outputs: of the commands that ran beside it.
    controller: of a machine without scales, which drives the machine in the place of `machine`.
    """

    configuration: Path
    directory: Path
    machine: ControlClient
    outputs: list[str] = field(default_factory=list)
    controller: PoseController | None = None

    @property
    def socket(self) -> Path:
        return self.directory / "compd.sock"

    def compd(self, *arguments: str | Path) -> str:
        """Output of a command; AssertionError with its errors where it fails."""
        done = self._compd(*arguments)
        assert done.returncode == 0, f"compd {' '.join(map(str, arguments))}: {done.stderr}{done.stdout}"
        return done.stdout

    def _compd(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "compd", *map(str, arguments)],
            cwd=self.directory,
            timeout=COMMAND_TIMEOUT_S,
            capture_output=True,
            text=True,
            check=False,
        )

    def zero(self) -> None:
        with connect(self.socket, COMMAND_TIMEOUT_S) as observer, connect(self.socket, COMMAND_TIMEOUT_S) as daemon:
            wait_for_gauges(observer, daemon.watch(10.0))
        for _ in range(ZERO_TRIES - 1):
            # on a busy computer a line may be late for a moment
            if self._compd("zero", "--daemon", self.socket).returncode == 0:
                return
        self.compd("zero", "--daemon", self.socket)

    def drive(self, visit: Visit) -> None:
        """Drive to a visit's place with its load and heaters, and rest there."""
        if visit.heat is not None:
            self.machine.ask("HEAT", **visit.heat)
        self.machine.ask("LOAD", force_M_N=visit.force_M_N)
        while self.controller is None:
            truth = self.machine.ask("DRIVE", scale_mm=visit.scale_mm)
            if np.abs(np.subtract(truth["scale_mm"], visit.scale_mm)).max() < ARRIVED_MM and not truth["moving"]:
                break
            threading.Event().wait(0.02)
        if self.controller is not None:
            self.controller.drive(self.machine, visit.scale_mm)
        threading.Event().wait(DWELL_S)

    def tip_error_um(self, visits: Sequence[Visit]) -> float:
        """rms per coordinate of the daemon's tip less the true one, um, at rest at each visit's place."""
        errors_mm = []
        with connect(self.socket, COMMAND_TIMEOUT_S) as daemon:
            setpoints = daemon.watch(20.0)
            for visit in visits:
                self.drive(visit)
                errors_mm.append(self._tip_error_mm(setpoints))
        return float(np.sqrt(np.mean(np.square(errors_mm)))) * 1e3

    def _tip_error_mm(self, setpoints: Iterator[dict[str, Any]]) -> NDArray[np.float64]:
        """The tip of the first setpoint whose readings are all of the present rest and fresh, less the true tip then.

        The frame drifts by some tenths of a micrometre a second, and on a busy computer a setpoint arrives late: the
        truth is what lies between one asked before and one asked after it, at the setpoint's time.
        """
        before_s, before = time.monotonic(), self.machine.ask("TRUTH")["tip_mm"]
        setpoint = next(message for message in setpoints if _is_of_this_rest(message, before_s))
        after, after_s = self.machine.ask("TRUTH")["tip_mm"], time.monotonic()
        share = (setpoint["time_s"] - before_s) / (after_s - before_s)
        return np.subtract(setpoint["tip_M_mm"], before) - share * np.subtract(after, before)

    def survey(self, visits: Sequence[Visit], name: str) -> tuple[Path, float]:
        """Record and track the visits; returns the joined recording and the tip's error during them, um."""
        part, track, joined = (self.directory / f"{name}{suffix}" for suffix in ("-0001.csv", ".track.csv", ".csv"))
        recorder = self.beside(
            "recording", "start", name, "--daemon", self.socket, "--rate-hz", str(RECORDER_HZ), begins="begins"
        )
        tracker = self.beside("sim", "tracker", self.directory, "--out", track, begins="looks")
        with recorder, tracker:
            error_um = self.tip_error_um(visits)
        self.outputs.append(
            self.compd(
                "recording", "join", part, track, joined, "--frame", "machine", "--sigma-um", str(TRACKER_SIGMA_UM)
            )
        )
        return joined, error_um

    @contextmanager
    def beside(self, *arguments: str | Path, begins: str) -> Iterator[None]:
        """A command that runs while the block does, from when it has printed `begins`."""
        process = subprocess.Popen(
            [sys.executable, "-m", "compd", *map(str, arguments)],
            cwd=self.directory,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert process.stdout is not None
        first = process.stdout.readline()
        assert begins in first, first + process.stdout.read()
        try:
            yield
        finally:
            process.terminate()
            self.outputs.append(first + process.communicate(timeout=COMMAND_TIMEOUT_S)[0])


def _is_of_this_rest(setpoint: dict[str, Any], since_s: float) -> bool:
    """Whether it is ok and its readings are fresh and later than `since_s`. AssertionError where it needs a person."""
    assert setpoint["state"] != "fault", setpoint["reason"]
    # without scales, and before a model needs thermometers, no reading is used
    age_s = setpoint.get("age_s", 0.0)
    return setpoint["state"] == "ok" and age_s <= FRESH_S and setpoint["time_s"] - age_s > since_s


@contextmanager
def hidden_run(directory: Path, *options: str, configuration: Path | None = None) -> Iterator[HiddenRun]:
    """`compd sim run` with `options`, and `compd run` on its wires; machine zero is taken.

    configuration : of another machine than the tripod of `write_configuration`.
    """
    config = configuration or write_configuration(directory)
    machine = directory / "machine"
    simulate = ["sim", "run", str(config), "--directory", str(machine), "--zero-hold", "600", *options]
    commands = [
        Command(simulate, ready=machine / "control.sock"),
        Command(["run", str(machine / config.name)], ready=machine / "compd.sock"),
    ]
    with ExitStack() as stack:
        stack.enter_context(run_commands(commands, log=directory / "output.log"))
        run = HiddenRun(config, machine, stack.enter_context(ControlClient(machine / "control.sock")))
        run.zero()
        yield run


def parse_output(output: str) -> dict[str, Any]:
    """A command's output with --json."""
    return dict(json.loads(output))
