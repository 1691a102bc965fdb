#!/usr/bin/python3
"""HAL component `machine`: hands the controller's motor commands to the simulated machine, and its probe's trip back.

    loadusr -Wn machine /usr/bin/python3 machine_link.py DIRECTORY

DIRECTORY has the simulation's control.sock, and where a probe is to touch something, artefact.json. motion.log is
written in the working directory. Runs under the Python of LinuxCNC, with the standard library and `hal` alone.

motion.log has one JSON list per logged period:
time (s, CLOCK_MONOTONIC), six nominal commands (mm), six drive commands (mm), the true tip at these drive commands
(mm, {M}) or null, watchdog content, feed inhibited, gauges to be read now, and since the last list the largest
correction (mm) and the largest change of a correction in one period (mm).
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
from typing import IO, Any, NamedTuple

import hal

PERIOD_S = 0.001  # of the servo thread: [EMCMOT] SERVO_PERIOD
LINKS = 6
# Samples of which one goes to the simulation, is logged, and is logged with the true tip.
FOLLOWED, LOGGED, WITH_TIP = 5, 10, 50
# Gain of the clock: share of the difference between a sample's time by count and by arrival; samples come in bursts.
CLOCK_GAIN = 0.01
# Difference (s) that shows a gap of the count.
CLOCK_GAP_S = 0.25
END_S = 1.0
# Hysteresis (mm) of probe-contact in probe.hal.
HYSTERESIS_MM = 0.002


class ServoSample(NamedTuple):
    """The sampler's data of one servo period; see machine.hal."""

    number: int
    nominal_mm: list[float]
    drive_mm: list[float]
    believed_mm: list[float]
    bits: list[bool]


def read_sample(line: bytes) -> ServoSample:
    number, *cells = line.split()
    values = [float(cell) for cell in cells[: 2 * LINKS + 3]]
    bits = [cell != b"0" for cell in cells[2 * LINKS + 3 :]]
    return ServoSample(int(number), values[:LINKS], values[LINKS : 2 * LINKS], values[2 * LINKS :], bits)


class Simulation:
    """The control socket of the simulated machine."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.connect(str(path))
        self._lines = self._socket.makefile("rb")

    def follow(self, commands: list[list[float]]) -> None:
        self._ask({"class": "FOLLOW", "commands": commands})

    def tip_mm(self, scale_mm: list[float]) -> list[float] | None:
        """The true tip at these scale values; None if the links cannot meet there."""
        return self._ask({"class": "TIP_FOR", "scale_mm": scale_mm}).get("tip_mm")

    def _ask(self, message: dict[str, Any]) -> dict[str, Any]:
        self._socket.sendall(json.dumps(message).encode() + b"\n")
        answer: dict[str, Any] = json.loads(self._lines.readline())
        return answer


class SampleClock:
    """Times of samples from their number: evenly spaced, with the mean delay of arrival."""

    def __init__(self) -> None:
        self._offset_s = math.nan

    def received(self, number: int, now_s: float) -> None:
        """The newest sample's number, as it arrives."""
        late_s = now_s - number * PERIOD_S
        if not abs(late_s - self._offset_s) < CLOCK_GAP_S:
            self._offset_s = late_s
        self._offset_s += CLOCK_GAIN * (late_s - self._offset_s)

    def time_s(self, number: int) -> float:
        return self._offset_s + number * PERIOD_S


class Probe:
    """Names the face of the artefact nearest to the tip, for the comparison in `probe.hal` in real time.

    The artefact is a set of calibrated corners, each the outermost in x, y and z of a cube: its three faces look
    outwards along x, y and z.

    Pins: normal-x, -y, -z; distance, of the face from the origin along the normal, for the place that the controller
    believes in, mm; aimed, whether these belong together.
    """

    def __init__(self, component: Any, corners_mm: list[list[float]]) -> None:
        self._pins = component
        self._corners_mm = corners_mm
        self._face: tuple[int, int] | None = None

    def aim(self, believed_mm: list[float], true_mm: list[float]) -> None:
        """The nearest face for the true tip at `true_mm` and the controller's one at `believed_mm`."""
        number = min(range(len(self._corners_mm)), key=lambda n: math.dist(self._corners_mm[n], true_mm))
        corner_mm = self._corners_mm[number]
        axis = max(range(3), key=lambda a: true_mm[a] - corner_mm[a])
        self._pins["aimed"] = self._face == (number, axis)
        self._face = (number, axis)
        for name, part in zip("xyz", (float(a == axis) for a in range(3)), strict=True):
            self._pins[f"normal-{name}"] = part
        # closes half of the hysteresis inside: the switch trips where the face is
        error_mm = true_mm[axis] - believed_mm[axis]
        self._pins["distance"] = corner_mm[axis] - error_mm + HYSTERESIS_MM / 2


class Link:
    """Reads samples, lets the simulation follow them, and logs them with the truth."""

    def __init__(self, directory: Path, component: Any) -> None:
        self._simulation = Simulation(directory / "control.sock")
        # open for the process's lifetime, written in whole lines: others read it meanwhile
        self._log: IO[str] = Path("motion.log").open("w", buffering=1)  # noqa: SIM115
        self._clock = SampleClock()
        # an orphan ignores SIGTERM, and its shared memory blocks the next LinuxCNC
        self._sampler = subprocess.Popen(["setpriv", "--pdeathsig", "KILL", "halsampler", "-t"], stdout=subprocess.PIPE)
        self._rest = b""
        self._before: list[float] | None = None
        self._largest_mm = self._step_mm = 0.0
        artefact = directory / "artefact.json"
        self._probe = Probe(component, json.loads(artefact.read_text())["corners_mm"]) if artefact.exists() else None

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
            samples = [read_sample(line) for line in lines if line and not line.startswith(b"overrun")]
            if samples:
                self._clock.received(samples[-1].number, time.monotonic())
                self._hand_over(samples)

    def end(self) -> None:
        self._sampler.terminate()
        try:
            self._sampler.wait(END_S)
        except subprocess.TimeoutExpired:
            self._sampler.kill()

    def _hand_over(self, samples: list[ServoSample]) -> None:
        followed = [sample for sample in samples if sample.number % FOLLOWED == 0]
        if followed:
            self._simulation.follow([[sample.number * PERIOD_S, *sample.drive_mm] for sample in followed])
        for sample in samples:
            self._watch(sample)
            if sample.number % LOGGED == 0:
                self._write(sample)

    def _watch(self, sample: ServoSample) -> None:
        correction_mm = [drive - nominal for drive, nominal in zip(sample.drive_mm, sample.nominal_mm, strict=True)]
        before = self._before or correction_mm
        steps_mm = [abs(now - last) for now, last in zip(correction_mm, before, strict=True)]
        self._before = correction_mm
        self._largest_mm = max(self._largest_mm, *(abs(value) for value in correction_mm))
        self._step_mm = max(self._step_mm, *steps_mm)

    def _write(self, sample: ServoSample) -> None:
        tip_mm = self._simulation.tip_mm(sample.drive_mm) if sample.number % WITH_TIP == 0 else None
        if tip_mm is not None and self._probe is not None:
            self._probe.aim(sample.believed_mm, tip_mm)
        row = [
            round(self._clock.time_s(sample.number), 4),
            sample.nominal_mm,
            sample.drive_mm,
            tip_mm,
            *sample.bits,
            self._largest_mm,
            self._step_mm,
        ]
        self._log.write(json.dumps(row) + "\n")
        self._largest_mm = self._step_mm = 0.0


def main() -> None:
    component = hal.component("machine")
    for name in ("normal-x", "normal-y", "normal-z", "distance"):
        component.newpin(name, hal.HAL_FLOAT, hal.HAL_OUT)
    component.newpin("aimed", hal.HAL_BIT, hal.HAL_OUT)
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
