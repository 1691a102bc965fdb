"""`compd calibrate --out --html`: files of a machine that the simulation has built, judged on poses of another day."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import compd
from compd.cli.app import app
from compd.machine_check import load_whole
from tests.support.built_machines import built, drawing, record


@pytest.fixture(scope="module")
def outputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("calibrated")
    rng = np.random.default_rng(4)
    machine = drawing("6-ups", directory)
    world = built(machine, rng)
    for name, count in (("learn", 60), ("friday", 30)):
        record(directory / f"{name}.csv", world, rng, count)
    arguments = ["--machine", machine, "--sealed", directory / "friday.csv", "--out", directory / "as-built.yaml"]
    arguments += ["--html", directory / "page.html"]
    done = CliRunner().invoke(app, ["calibrate", str(directory / "learn.csv"), *map(str, arguments)])
    assert done.exit_code == 0, done.output
    assert "as-built.yaml: the machine as built" in " ".join(done.output.split())
    return directory


def test_the_machine_as_built_errs_less_on_another_day(outputs: Path) -> None:
    configuration = load_whole(outputs / "as-built.yaml")
    model = None if configuration.state.model_file is None else configuration.state.model_file
    before, after = (
        compd.compare(compd.open_recording(outputs / "friday.csv", outputs / name), model=own).rms_um
        for name, own in (("6-ups.yaml", None), ("as-built.yaml", model))
    )
    # the instrument has 5 um per coordinate
    assert before > 15
    assert after < 8


def test_the_files_of_the_drawing_stay(outputs: Path) -> None:
    arguments = ["calibrate", str(outputs / "learn.csv"), "--machine", str(outputs / "6-ups.yaml"), "--out"]
    done = CliRunner().invoke(app, [*arguments, str(outputs / "6-ups.yaml")])
    assert isinstance(done.exception, compd.CompdError)
    assert "is there already, and is not a machine as built" in str(done.exception)


def test_the_page_says_what_fell_and_wants_nothing_from_elsewhere(outputs: Path) -> None:
    text = (outputs / "page.html").read_text(encoding="utf-8")
    text = text[text.index("</head>") :]
    assert not re.search(r"(src|href)=\"http", text)
    for words in (
        "sealed friday.csv",
        "Errors of the links",
        "rod 1 base x",
        "actuator 3 gain",
        "all base joints together",
    ):
        assert words in text
    # arrows of all states and figures have one scale
    assert len(set(re.findall(r"enlarged (\d+) times", text))) == 1
