#!/usr/bin/python3
"""HAL component `machine`: hands the controller's motor commands to the simulated machine, and its probe's trip back.

    loadusr -Wn machine /usr/bin/python3 machine_link.py DIRECTORY

DIRECTORY has the simulation's control.sock; motion.log is written there, and artefact.json read, if it is there.
Runs under the Python of LinuxCNC, with the standard library and `hal` alone.

motion.log has one JSON list per logged period:
time (s, CLOCK_MONOTONIC), six nominal commands (mm), six drive commands (mm), the true tip at these drive commands
(mm, {M}) or null, watchdog content, feed inhibited, touch mark, and since the last list the largest correction (mm) and
the largest change of a correction in one period (mm).
"""

from __future__ import annotations

import json
import math
import os
import select
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import IO, Any

import hal

PERIOD_S = 0.001  # of the servo thread: [EMCMOT] SERVO_PERIOD
LINKS = 6
# One sample in so many goes to the simulation, is logged, and is looked at for the true tip.
FOLLOWED, LOGGED, LOOKED = 5, 10, 50
# Share of the difference between a sample's time by count and by arrival that is believed: samples come in bursts.
CLOCK_GAIN = 0.01
# Beyond this difference, s, the count has had a gap.
CLOCK_GAP_S = 0.25


class Simulation:
    """The control socket of the simulated machine."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.connect(str(path))
        self._lines = self._socket.makefile("rb")

    def ask(self, **message: Any) -> dict[str, Any]:
        self._socket.sendall(json.dumps(message).encode() + b"\n")
        answer: dict[str, Any] = json.loads(self._lines.readline())
        return answer


class SampleClock:
    """Times of samples from their number: evenly spaced, and as late as samples arrive on the average."""

    def __init__(self) -> None:
        self._offset_s = math.nan

    def heard(self, number: int, now_s: float) -> None:
        """The newest sample's number, as it arrives."""
        late_s = now_s - number * PERIOD_S
        if not abs(late_s - self._offset_s) < CLOCK_GAP_S:
            self._offset_s = late_s
        self._offset_s += CLOCK_GAIN * (late_s - self._offset_s)

    def time_s(self, number: int) -> float:
        return self._offset_s + number * PERIOD_S


class Probe:
    """Touches a calibrated ball: chooses the tangential plane that `probe.hal` compares with, in real time.

    Pins: normal-x, -y, -z, the outward normal at the place that is nearest to the tip; distance, how far that plane is
    from the origin along the normal, for the place that the controller believes in, mm.
    """

    def __init__(self, component: hal.component, artefact: dict[str, Any]) -> None:
        self._pins = component
        self._balls_mm: list[list[float]] = artefact["balls_mm"]
        self._radius_mm: float = artefact["radius_mm"]

    def aim(self, believed_mm: list[float], true_mm: list[float]) -> None:
        ball_mm = min(self._balls_mm, key=lambda ball_mm: math.dist(ball_mm, true_mm))
        away_mm = [tip - ball for tip, ball in zip(true_mm, ball_mm)]
        far_mm = math.hypot(*away_mm)
        normal = [part / far_mm for part in away_mm]
        for axis, part in zip("xyz", normal):
            self._pins[f"normal-{axis}"] = part
        error_mm = sum(n * (tip - place) for n, tip, place in zip(normal, true_mm, believed_mm))
        plane_mm = sum(n * ball for n, ball in zip(normal, ball_mm)) + self._radius_mm
        self._pins["distance"] = plane_mm - error_mm


class Link:
    """Reads samples, lets the simulation follow them, and logs them with the truth."""

    def __init__(self, directory: Path, component: hal.component) -> None:
        self._pins = component
        self._simulation = Simulation(directory / "control.sock")
        self._log: IO[str] = (directory / "motion.log").open("w", buffering=1)
        self._clock = SampleClock()
        self._sampler = subprocess.Popen(["halsampler", "-t"], stdout=subprocess.PIPE)
        self._rest = b""
        self._before: list[float] | None = None
        self._largest_mm = self._step_mm = 0.0
        artefact = directory / "artefact.json"
        self._probe = Probe(component, json.loads(artefact.read_text())) if artefact.exists() else None

    def run(self) -> None:
        """Until the process is told to end, or the sampler ends."""
        assert self._sampler.stdout is not None
        descriptor = self._sampler.stdout.fileno()
        while True:
            select.select([descriptor], [], [])
            piece = os.read(descriptor, 1 << 16)
            if not piece:
                return
            *lines, self._rest = (self._rest + piece).split(b"\n")
            samples = [line.split() for line in lines if line and not line.startswith(b"overrun")]
            if samples:
                self._clock.heard(int(samples[-1][0]), time.monotonic())
                self._hand_over(samples)

    def end(self) -> None:
        self._sampler.terminate()
        self._sampler.wait()

    def _hand_over(self, samples: list[list[bytes]]) -> None:
        commands = []
        looked = []
        for sample in samples:
            number = int(sample[0])
            values = [float(value) for value in sample[1 : 1 + 2 * LINKS]]
            nominal_mm, drive_mm = values[:LINKS], values[LINKS:]
            self._watch(nominal_mm, drive_mm)
            if number % FOLLOWED == 0:
                commands.append([number * PERIOD_S, *drive_mm])
            if number % LOGGED == 0:
                bits = [bool(int(value)) for value in sample[1 + 2 * LINKS :]]
                looked.append((number, nominal_mm, drive_mm, bits))
        if commands:
            self._simulation.ask(**{"class": "FOLLOW"}, commands=commands)
        for number, nominal_mm, drive_mm, bits in looked:
            tip_mm = None
            if number % LOOKED == 0:
                tip_mm = self._simulation.ask(**{"class": "TIP_FOR"}, scale_mm=drive_mm).get("tip_mm")
            if tip_mm is not None and self._probe is not None:
                self._probe.aim([self._pins[f"believed-{axis}"] for axis in "xyz"], tip_mm)
            row = [self._clock.time_s(number), nominal_mm, drive_mm, tip_mm, *bits, self._largest_mm, self._step_mm]
            self._log.write(json.dumps(row) + "\n")
            self._largest_mm = self._step_mm = 0.0

    def _watch(self, nominal_mm: list[float], drive_mm: list[float]) -> None:
        correction_mm = [drive - nominal for drive, nominal in zip(drive_mm, nominal_mm)]
        before = self._before or correction_mm
        steps_mm = [abs(now - last) for now, last in zip(correction_mm, before)]
        self._before = correction_mm
        self._largest_mm = max(self._largest_mm, *(abs(value) for value in correction_mm))
        self._step_mm = max(self._step_mm, *steps_mm)


def main() -> None:
    component = hal.component("machine")
    for axis in "xyz":
        component.newpin(f"normal-{axis}", hal.HAL_FLOAT, hal.HAL_OUT)
        component.newpin(f"believed-{axis}", hal.HAL_FLOAT, hal.HAL_IN)
    component.newpin("distance", hal.HAL_FLOAT, hal.HAL_OUT)
    link = Link(Path(sys.argv[1]), component)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    component.ready()
    try:
        link.run()
    finally:
        link.end()
        component.exit()


if __name__ == "__main__":
    main()
