"""`compd calibrate`: what it prints of a machine that `compd.simulation` builds otherwise than drawn."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tests.support.built_machines import built, drawing, record
from tests.support.command import run_in_process


def test_errors_numbers_and_what_poses_do_not_tell_are_printed(tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    world = built(drawing("6-ups", tmp_path), rng)
    learned = record(tmp_path / "monday.csv", world, rng, 40, gross_mm={4: 2.0})
    sealed = record(tmp_path / "friday.csv", world, rng, 30)
    printed = run_in_process("calibrate", str(learned), "--sealed", str(sealed), "--check", str(sealed))
    words = " ".join(printed.split())
    for text in (
        "6-ups: the error at poses that were left out falls from",
        "sealed friday.csv",
        "rod 1 length",
        "all base joints together, along x",
        "left out: monday.csv row 6",
        "the calibration holds",
    ):
        assert text in words, text
    data = json.loads(run_in_process("calibrate", str(learned), "--sealed", str(sealed), "--json"))
    assert data["sealed"][0]["after_rms_um"] < data["sealed"][0]["before_rms_um"]
    assert [pose["row"] for pose in data["gross"]] == [6]
