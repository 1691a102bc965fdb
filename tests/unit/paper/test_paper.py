"""The paper's experiments run, gain what they must, and print what they found beside what the paper states."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import drift_experiment
import link_experiment
import plate_experiment
from compd.arrays import rms
from compd.configuration import Configuration, load
from compd.simulation.truth import strengths
from reproduction import Reduction
from tests.support.paths import ROOT
from tests.support.sampled import sampled
from tests.support.simulated import HEXAPOD, TRIPOD


@pytest.fixture(scope="module")
def tripod() -> Configuration:
    return load(TRIPOD)


def test_figure_18_load_and_warmth_hardly_show_with_rods_and_comparators(tripod: Configuration) -> None:
    result = link_experiment.run(tripod, 3)
    slope = np.polyfit(result.without.axial_N, result.without.cold_um, 1)[0]
    # tube and screw, and the ball at the base and at the platform that no comparator is asked about
    gives = link_experiment.TUBE_UM_PER_N + 2 * strengths.Strengths().ball_give_along_um_per_N
    assert slope == pytest.approx(-gives, rel=0.05)  # it warms up a little meanwhile
    assert np.ptp(result.without.axial_N) > 60.0
    assert result.without.link_degC[-1] - result.without.link_degC[0] > 1.0
    for reduction in link_experiment.reductions(result):
        assert reduction.percent > 80.0


def test_figure_20_has_136_distances_and_the_joints_gain_most_of_it(tripod: Configuration) -> None:
    result = plate_experiment.run(tripod, 3)
    assert len(result.nominal_mm) == 17 * 16 / 2
    assert rms(result.joints_um) < rms(result.without_um)
    assert rms(result.full_um) < rms(result.joints_um)
    first = plate_experiment.reductions(result)[0]
    assert first.percent == pytest.approx(100 * (1 - rms(result.joints_um) / rms(result.without_um)))
    assert "32 %" in first.paper


@pytest.mark.long
def test_figure_20_gains_nothing_where_the_joints_are_perfect(
    tripod: Configuration, monkeypatch: pytest.MonkeyPatch
) -> None:
    perfect = replace(strengths.Strengths(), ball_runout_um=0.0, ball_give_along_um_per_N=0.0)
    monkeypatch.setattr("compd.simulation.truth.world.Strengths", lambda: perfect)
    result = plate_experiment.run(tripod, 3)
    assert abs(plate_experiment.reductions(result)[0].percent) < 5.0


@pytest.mark.long
def test_figure_21_the_ball_stands_still_once_the_frame_is_measured(tripod: Configuration) -> None:
    result = drift_experiment.run(tripod, 3)
    z, x, y = drift_experiment.reductions(result)
    assert z.without_um > 10.0
    assert z.without_um > max(x.without_um, y.without_um)
    assert z.percent > 80.0
    assert len(result.time_h) > 50


def run_script(directory: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, ROOT / "examples" / "paper" / "reproduce.py", *arguments]
    environment = {**os.environ, "COLUMNS": "160"}
    return subprocess.run(command, cwd=directory, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("experiment", "printed"),
    sampled(
        [
            ("fig18", "reduction"),
            ("fig20", "32 % by the joints"),
            ("fig21", "reduction"),
            ("instantaneous", "power 2.00"),
        ],
        3,
    ),
)
def test_the_script_prints_a_table_and_draws_a_page(tmp_path: Path, experiment: str, printed: str) -> None:
    done = run_script(tmp_path, experiment)
    assert done.returncode == 0, done.stderr
    assert printed in done.stdout
    text = (tmp_path / "out" / f"{experiment}.html").read_text(encoding="utf-8")
    assert printed.partition(" ")[0] in text
    assert text.count("Plotly.newPlot") >= 1


@pytest.mark.long
@pytest.mark.sample
def test_the_script_takes_a_machine_a_page_and_a_seed_and_says_what_is_wrong(tmp_path: Path) -> None:
    page = tmp_path / "pictures" / "hexapod.html"
    done = run_script(tmp_path, "fig20", str(HEXAPOD), "--seed", "2", "--page", str(page))
    assert done.returncode == 0, done.stderr
    assert "The paper: 32 % by the joints" in page.read_text(encoding="utf-8")
    refused = run_script(tmp_path, "fig20", "nowhere.yaml")
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "nowhere.yaml" in refused.stderr
    assert "Traceback" not in refused.stderr


def test_reduction_is_a_share_of_what_was_there() -> None:
    assert Reduction("", 4.0, 1.0, "").percent == pytest.approx(75.0)
