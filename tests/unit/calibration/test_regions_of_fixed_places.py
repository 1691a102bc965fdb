"""Balls and pins whose rows are all in a region that is left out: their places are no error of the machine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import compd
from compd.cli.app import app
from tests.support.built_machines import built, drawing


@pytest.mark.parametrize("reference", ["ball", "pin"])
def test_a_ball_of_which_no_row_is_known_is_placed_by_its_own_rows(tmp_path: Path, reference: str) -> None:
    machine = drawing("6-ups", tmp_path)
    built(machine, np.random.default_rng(2))
    out = tmp_path / "touched.csv"
    arguments = [
        "sim",
        "campaign",
        tmp_path / "built-6-ups.yaml",
        "--reference",
        reference,
        "--seed",
        "4",
        "--out",
        out,
    ]
    assert CliRunner().invoke(app, list(map(str, arguments))).exit_code == 0
    recording = compd.open_recording(out, machine)
    result = compd.calibrate(recording, blocks=["link_zero", "base_joint_position", "platform_joint_position"])
    random, regions = result.held_out
    # the places are some 100 mm apart: a place that is left where it began would be an error of millimetres
    assert regions.before_rms_um < 10 * random.before_rms_um
    assert regions.after_rms_um < regions.before_rms_um / 3
