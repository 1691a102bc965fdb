"""What the demonstration on LinuxCNC makes of the controller's log and of the recorder's files."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from artefact import (
    CLEAR_mm,
    CORNERS_mm,
    probing_program,
    reading_times_s,
    write_probed_recording,
)
from compd.errors import DaemonError
from compd.recording import sidecar_contents, write_recording
from compd.simulation import Mechanism
from controller import LinuxCnc, ProgramStopped
from motion_log import read_motion_log, tip_errors, wanted_tips_mm
from tests.support.paths import ROOT
from tests.support.simulated import hexapod

PERIOD_S = 0.01
UP_MM = 0.004


def scales_mm(tip_M_mm: np.ndarray) -> np.ndarray:
    drawn = Mechanism(hexapod())
    return drawn.lengths(drawn.posture_at(tip_M_mm, np.zeros(3))) - drawn.lengths0_mm


def write_log(
    path: Path, readings: tuple[tuple[float, float], ...] = (), held: tuple[float, float] = (np.inf, np.inf)
) -> None:
    """Two seconds on the move, two at rest; the true tip is 4 um above where the program wants it, every fifth time.

    held : from when to when the feed was, s; the tip is 1 mm off then.
    """
    lines = []
    for number in range(400):
        tip_mm = np.array([0.1 * min(number, 200), 0.0, 320.0])
        nominal_mm = scales_mm(tip_mm).tolist()
        time_s = 1000.0 + number * PERIOD_S
        inhibited = held[0] <= time_s <= held[1]
        up_mm = 1.0 if inhibited else UP_MM
        true_mm = np.add(tip_mm, [0.0, 0.0, up_mm]).tolist() if number % 5 == 0 else None
        reading = any(start_s <= time_s <= end_s for start_s, end_s in readings)
        lines.append(json.dumps([time_s, nominal_mm, nominal_mm, true_mm, True, inhibited, reading, 0.0, 0.0]))
    path.write_text("\n".join([*lines, "[1004.0, [0.0, 0"]))


def test_tip_errors_at_rest_and_on_the_move(tmp_path: Path) -> None:
    write_log(tmp_path / "motion.log")
    samples = read_motion_log(tmp_path / "motion.log")
    assert len(samples) == 400  # the last line is not written yet
    errors = tip_errors(Mechanism(hexapod()), samples)
    assert len(errors.at_rest_um) == pytest.approx(32, abs=1)
    assert len(errors.moving_um) == pytest.approx(48, abs=1)
    np.testing.assert_allclose(errors.error_um, UP_MM * 1e3, atol=1e-6)
    assert errors.time_s[[0, -1]] == pytest.approx([0.0, 395 * PERIOD_S], abs=1e-6)
    assert errors.summary() == ["4.00"] * 4


def test_a_program_without_rests_has_no_error_at_rest(tmp_path: Path) -> None:
    write_log(tmp_path / "motion.log")
    samples = read_motion_log(tmp_path / "motion.log", end_s=1001.9)
    assert tip_errors(Mechanism(hexapod()), samples).summary() == ["-", "-", "4.00", "4.00"]


def test_a_log_without_samples_has_no_error(tmp_path: Path) -> None:
    (tmp_path / "motion.log").write_text("")
    samples = read_motion_log(tmp_path / "motion.log")
    assert tip_errors(Mechanism(hexapod()), samples).summary() == ["-"] * 4


def test_the_wanted_tip_is_that_of_the_kinematics_as_drawn() -> None:
    tips_mm = [np.array([0.0, 0.0, 320.0]), np.array([20.0, -10.0, 330.0]), np.array([50.0, 40.0, 300.0])]
    found_mm = wanted_tips_mm(Mechanism(hexapod()), [scales_mm(tip_mm) for tip_mm in tips_mm])
    np.testing.assert_allclose(found_mm, tips_mm, atol=1e-9)


def test_a_probed_recording_has_the_gauges_of_each_mark_and_the_calibrated_place(tmp_path: Path) -> None:
    marks = ((1002.5, 1002.9), (1003.3, 1003.7))
    write_log(tmp_path / "motion.log", marks)
    samples = read_motion_log(tmp_path / "motion.log")
    times = reading_times_s(samples)
    np.testing.assert_allclose(times, marks, atol=0.011)
    time_s = np.arange(0.0, 5.0, 0.1)
    columns = {"time_s": time_s, "scale_1_mm": np.where(time_s < 3.0, 7.0, 9.0), "joint_1_um": np.full(50, 1.5)}
    columns["joint_1_um"][26] = np.nan  # a gauge that was late: the row does not count
    sidecar = sidecar_contents("hexapod", provenance={"started_at_monotonic_s": 1000.0})
    write_recording(tmp_path / "gauges-0001.csv", columns, sidecar)
    rows = write_probed_recording(tmp_path / "probed.csv", [tmp_path / "gauges-0001.csv"], [samples])
    assert rows == 2
    head, *lines = (tmp_path / "probed.csv").read_text().splitlines()
    first, second = (dict(zip(head.split(","), map(float, line.split(",")), strict=True)) for line in lines)
    assert (first["scale_1_mm"], second["scale_1_mm"]) == (7.0, 9.0)
    assert (first["session"], first["point"], second["point"]) == (1, 1, 2)
    assert [second[f"reference_{axis}_mm"] for axis in "xyz"] == [place + CLEAR_mm for place in CORNERS_mm[1]]


@pytest.mark.parametrize("at_zero", [None, {"temperature_link_1_degC": 23.5, "pressure_hPa": 987.0}])
def test_a_probed_recording_counts_from_where_its_gauges_do(tmp_path: Path, at_zero: dict[str, float] | None) -> None:
    write_log(tmp_path / "motion.log", ((1002.5, 1002.9),))
    sidecar = sidecar_contents(
        "hexapod",
        provenance={"started_at_monotonic_s": 1000.0},
        quantities_at_zero=at_zero,
        machine_file=tmp_path / "machine.yaml",
    )
    columns = {"time_s": np.arange(0.0, 5.0, 0.1), "scale_1_mm": np.zeros(50)}
    write_recording(tmp_path / "gauges-0001.csv", columns, sidecar)
    samples = read_motion_log(tmp_path / "motion.log")
    assert write_probed_recording(tmp_path / "probed.csv", [tmp_path / "gauges-0001.csv"], [samples]) == 1
    probed = yaml.safe_load((tmp_path / "probed.yaml").read_text())
    assert (probed.get("quantities_at_zero"), probed["machine_file"]) == (at_zero, "machine.yaml")


def test_a_feed_that_was_held_counts_as_no_error_and_gives_no_row(tmp_path: Path) -> None:
    write_log(tmp_path / "motion.log", ((1002.5, 1002.9), (1003.3, 1003.7)), held=(1003.0, 1003.4))
    samples = read_motion_log(tmp_path / "motion.log")
    np.testing.assert_allclose(tip_errors(Mechanism(hexapod()), samples).error_um, UP_MM * 1e3, atol=1e-6)
    columns = {"time_s": np.arange(0.0, 5.0, 0.1), "scale_1_mm": np.zeros(50)}
    sidecar = sidecar_contents("hexapod", provenance={"started_at_monotonic_s": 1000.0})
    write_recording(tmp_path / "gauges-0001.csv", columns, sidecar)
    assert write_probed_recording(tmp_path / "probed.csv", [tmp_path / "gauges-0001.csv"], [samples]) == 1


class Panel(LinuxCnc):
    """LinuxCNC as its panel answers, without LinuxCNC: a program that is held until the bridge is armed."""

    def __init__(self, directory: Path, held_by: str, message: str = "") -> None:
        super().__init__(directory, directory)
        self.held, self.message, self.asked = held_by, message, 0

    def ask(self, do: str, timeout_s: float = 0.0, **arguments: Any) -> Any:
        if do == "wait_for_end":
            self.asked += 1
            if self.message:
                self.errors.append(self.message)
            return not self.held
        return self.held if do == "held_by" else True


def test_a_program_whose_feed_is_held_goes_on_when_somebody_attends(tmp_path: Path) -> None:
    panel, seen = Panel(tmp_path, "the last setpoint has expired"), []

    def attend(held_by: str) -> None:
        seen.append(held_by)
        panel.held = "" if len(seen) == 2 else panel.held

    start_s, end_s = panel.run(tmp_path / "program.ngc", 600.0, attend)
    assert start_s <= end_s
    assert seen == ["the last setpoint has expired"] * 2


def test_a_program_that_does_not_end_says_what_holds_it(tmp_path: Path) -> None:
    with pytest.raises(DaemonError, match=r"program.ngc has not ended.*the last setpoint has expired"):
        Panel(tmp_path, "the last setpoint has expired").run(tmp_path / "program.ngc", 0.0)


def test_a_message_of_linuxcnc_stops_a_program_and_lateness_does_not(tmp_path: Path) -> None:
    Panel(tmp_path, "", "Unexpected realtime delay on task 0").run(tmp_path / "program.ngc", 600.0)
    with pytest.raises(ProgramStopped, match="Probe is already tripped"):
        Panel(tmp_path, "", "Probe is already tripped").run(tmp_path / "program.ngc", 600.0)


def test_the_probing_program_touches_three_faces_of_every_corner() -> None:
    program = probing_program()
    assert program.count("o<corner> call") == len(CORNERS_mm)
    assert program.count("o<face> call") == 3
    assert program.count("G38.2") == 2


def test_the_script_names_the_package_where_linuxcnc_is_missing(tmp_path: Path) -> None:
    command = [sys.executable, ROOT / "examples" / "linuxcnc" / "run.py"]
    done = subprocess.run(command, cwd=tmp_path, env={"PATH": ""}, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert "apt-get install linuxcnc-uspace" in done.stderr


def test_the_old_option_names_the_script() -> None:
    done = subprocess.run([sys.executable, "-m", "compd", "demo", "--linuxcnc"], capture_output=True, check=False)
    assert done.returncode == 2
    assert b"examples/linuxcnc/run.py" in done.stderr
