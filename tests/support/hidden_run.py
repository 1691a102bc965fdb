"""A simulated machine with a secret, the daemon on its wires, and a laser tracker beside it: by `compd` alone.

What a person would do by hand is done here: drive about, load the tip, let the tracker look, call the commands.
Nothing here knows what is hidden.
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

from compd.client import connect
from compd.configuration.document import read_document
from compd.demo.processes import Command, running
from compd.demo.session import ARRIVED_MM, MachineController, wait_for_gauges
from tests.support.hidden_visits import Visit
from tests.support.simulated import TRIPOD

# Half the tracker's rate: every row has looks of its own.
RECORDER_HZ = 10.0
TRACKER_SIGMA_UM = 0.15
# Slower than shipped, for two thirds of the processor time. Not slower still: the frame moves while it is read.
LOOP_HZ, POLL_EVERY_S = 100, 0.02
# Twice as long as the slowest gauge needs to be read anew, and the tracker to have looked three times.
DWELL_S = 0.8
COMMAND_TIMEOUT_S = 120.0
ZERO_TRIES = 3
MORE_CHANNELS = ("force_x_N", "force_y_N", "force_z_N", "pressure_hPa", "humidity_pct")


def equipped(directory: Path) -> Path:
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
    # several machines side by side on one computer: each with its own Unix socket, none in a hurry
    del data["sockets"]["tcp"]
    data["loop"]["rate_hz"] = LOOP_HZ
    for line in data["lines"].values():
        line.setdefault("poll_every_s", POLL_EVERY_S)
    path = directory / TRIPOD.name
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return path


@dataclass
class HiddenRun:
    """A machine that runs, seen from outside.

    configuration: as a person wrote it; directory: of the simulation; machine: its controller.
    said: what commands beside it printed.
    """

    configuration: Path
    directory: Path
    machine: MachineController
    said: list[str] = field(default_factory=list)

    @property
    def socket(self) -> Path:
        return self.directory / "compd.sock"

    def compd(self, *arguments: str | Path) -> str:
        """What a command prints; AssertionError with all its words where it fails."""
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
            # as the refusal says: a line that was late on a busy computer is well again a moment later
            if self._compd("zero", self.socket).returncode == 0:
                return
        self.compd("zero", self.socket)

    def drive(self, visit: Visit) -> None:
        """Go there, under its load, with its heaters on, and rest there."""
        if visit.heat is not None:
            self.machine.ask("HEAT", **visit.heat)
        self.machine.ask("LOAD", force_M_N=visit.force_M_N)
        while True:
            truth = self.machine.ask("DRIVE", scale_mm=visit.scale_mm)
            if np.abs(np.subtract(truth["scale_mm"], visit.scale_mm)).max() < ARRIVED_MM and not truth["moving"]:
                break
            threading.Event().wait(0.02)
        threading.Event().wait(DWELL_S)

    def tip_error_um(self, visits: Sequence[Visit]) -> float:
        """rms per coordinate of what the daemon says of the tip, against the truth, at rest at each visit's place."""
        wrong = []
        with connect(self.socket, COMMAND_TIMEOUT_S) as daemon:
            setpoints = daemon.watch(20.0)
            for visit in visits:
                self.drive(visit)
                arrived_s = time.monotonic()
                setpoint = next(one for one in setpoints if one["time_s"] > arrived_s and one["state"] == "ok")
                wrong.append(np.subtract(setpoint["tip_M_mm"], self.machine.ask("TRUTH")["tip_mm"]))
        return float(np.sqrt(np.mean(np.square(wrong)))) * 1e3

    def survey(self, visits: Sequence[Visit], name: str) -> tuple[Path, float]:
        """The daemon records and the tracker looks: the recording, joined, and the tip's error meanwhile, in um."""
        part, track, joined = (self.directory / f"{name}{suffix}" for suffix in ("-0001.csv", ".track.csv", ".csv"))
        recorder = self.beside("record", name, "--daemon", self.socket, "--rate-hz", str(RECORDER_HZ), begins="begins")
        tracker = self.beside("tracker", self.directory, "--out", track, begins="looks")
        with recorder, tracker:
            error_um = self.tip_error_um(visits)
        self.said.append(
            self.compd("join", part, track, joined, "--frame", "machine", "--sigma-um", str(TRACKER_SIGMA_UM))
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
            self.said.append(first + process.communicate(timeout=COMMAND_TIMEOUT_S)[0])


@contextmanager
def hidden_run(directory: Path, *options: str) -> Iterator[HiddenRun]:
    """`compd simulate` with `options`, and `compd run` on its wires; machine zero is taken."""
    config = equipped(directory)
    machine = directory / "machine"
    simulate = ["simulate", str(config), "--directory", str(machine), "--zero-hold", "600", *options]
    commands = [
        Command(simulate, ready=machine / "control.sock"),
        Command(["run", str(machine / config.name)], ready=machine / "compd.sock"),
    ]
    with ExitStack() as stack:
        stack.enter_context(running(commands, log=directory / "output.log"))
        run = HiddenRun(config, machine, stack.enter_context(MachineController(machine / "control.sock")))
        run.zero()
        yield run


def told(output: str) -> dict[str, Any]:
    return dict(json.loads(output))
