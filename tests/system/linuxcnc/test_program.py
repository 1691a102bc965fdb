"""A G-code program through LinuxCNC on a simulated hexapod that warms up: the tip's error with corrections and without.

-rP prints the figures.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from compd.arrays import rms
from compd.configuration import load
from compd.demo import simulated_daemon, take_zero
from compd.simulation import Mechanism
from controller import LinuxCnc, obstacle
from demonstration import SHIPPED_PROGRAM
from motion_log import TipErrors, read_motion_log, tip_errors
from tests.support.paths import ROOT
from tests.support.simulated import HEXAPOD

pytestmark = [pytest.mark.skipif(bool(obstacle()), reason=obstacle())]

SPEEDUP = 60.0
MAX_S = 120.0


@pytest.fixture
def machine() -> Iterator[LinuxCnc]:
    """LinuxCNC on, homed, and with a program, on a machine with every ordinary error."""
    with simulated_daemon(load(HEXAPOD), 3, SPEEDUP, 3600.0) as directory:
        take_zero(directory / "compd.sock")
        with LinuxCnc(directory / "controller", directory) as controller:
            controller.switch_on()
            yield controller


def run(machine: LinuxCnc, program: Path) -> TipErrors:
    start_s, end_s = machine.run(program, MAX_S, lambda _: machine.arms())
    return tip_errors(Mechanism(load(HEXAPOD).geometry), read_motion_log(machine.motion_log, start_s, end_s))


@pytest.mark.long
def test_the_tip_error_at_rest_is_ten_times_smaller_with_corrections(machine: LinuxCnc) -> None:
    """Half an hour of warming up passes first, with corrections; then the program runs without them, and with them."""
    program = machine.directory / "program.ngc"
    program.write_text(SHIPPED_PROGRAM.read_text())
    machine.give(program)
    machine.with_corrections()
    run(machine, program)
    machine.without_corrections()
    machine.set_signal("compd-clear", "1")
    without = run(machine, program)
    machine.set_signal("compd-clear", "0")
    machine.with_corrections()
    corrected = run(machine, program)
    print("rms and largest in um, at rest and on the move")
    print("without", *without.summary())
    print("with", *corrected.summary())
    assert rms(without.at_rest_um) >= 10 * rms(corrected.at_rest_um)
    assert rms(without.moving_um) >= 5 * rms(corrected.moving_um)


@pytest.mark.long
@pytest.mark.timeout(1200)
def test_the_script_probes_diagnoses_and_adopts_what_is_left(tmp_path: Path) -> None:
    command = [sys.executable, ROOT / "examples" / "linuxcnc" / "run.py", "--seed", "3"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=1190)
    print(done.stdout)
    assert done.returncode == 0, done.stderr
    said = " ".join(done.stdout.split())
    off_um, on_um, adopted_um = (float(um) for um in re.findall(r"([\d.]+) um with (?:corr|the)", said))
    (effects,) = re.findall(r"; adopted: (.*?)\. The same", said)
    assert "link_expansion" in effects
    assert min(off_um, on_um) >= 3 * adopted_um
    assert "Plotly.newPlot" in (tmp_path / "out" / "linuxcnc" / "program.html").read_text(encoding="utf-8")
