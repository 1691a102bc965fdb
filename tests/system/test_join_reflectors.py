"""Several reflectors at different places on the platform: an export that names them is joined, and calibrates."""

from __future__ import annotations

import csv
import re
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from compd.cli.app import app
from compd.recording import read_recording
from tests.support.built_machines import NOISE_MM, built, drawing, poses, targets

POSES, VISITS = 40, 2
PLACES_MM = {"top": [60.0, 0.0, -15.0], "left": [-30.0, 50.0, 10.0], "right": [-30.0, -50.0, 25.0]}


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A machine, its log, and the instrument's points: three reflectors at each pose, each twice, one hidden once."""
    directory = tmp_path_factory.mktemp("reflectors")
    rng = np.random.default_rng(40)
    world = built(drawing("6-ups", directory), rng)
    frame, at_mm = Rotation.from_rotvec(rng.uniform(-1, 1, 3)), rng.uniform(-500, 500, 3)
    log, points = [], []
    for number, (reading_mm, tip_mm, R) in enumerate(islice(poses(world, targets(world, rng)), POSES), start=1):
        log.append([f"Q{number:03d}", *reading_mm])
        for name, place_P_mm in PLACES_MM.items():
            if (name, number) == ("left", 7):
                continue
            for visit in range(VISITS):
                seen_mm = frame.apply(tip_mm + R @ np.array(place_P_mm)) + at_mm + NOISE_MM * rng.standard_normal(3)
                points.append([f"Q{number:03d}", name, visit, *seen_mm])
    write(directory / "log.csv", ["pose", *(f"scale_{i}_mm" for i in range(1, 7))], log)
    write(directory / "points.csv", ["point", "SMR", "run", "x [mm]", "y [mm]", "z [mm]"], points)
    return directory


def write(path: Path, header: list[str], rows: list[list[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([header, *rows])


def run(*arguments: object) -> str:
    done = CliRunner().invoke(app, list(map(str, arguments)))
    assert done.exit_code == 0, (done.output, done.exception)
    return done.output


def join(directory: Path, out: str, *options: str) -> Path:
    files = (directory / "log.csv", directory / "points.csv", directory / out)
    run(
        "recording",
        "join",
        *files,
        "--machine",
        directory / "6-ups.yaml",
        "--log",
        "pose=point",
        "--by",
        "name",
        *options,
    )
    return directory / out


def with_places() -> list[str]:
    return [
        part for name, xyz in PLACES_MM.items() for part in ("--reflector-place", f"{name}={','.join(map(str, xyz))}")
    ]


def test_each_row_names_its_reflector(measured: Path) -> None:
    joined = read_recording(join(measured, "rows.csv", *with_places()))
    assert joined.rows == VISITS * (3 * POSES - 1)
    assert set(joined.labels["reflector"]) == set(PLACES_MM)
    assert joined.visit is not None
    assert joined.target_P_mm is not None
    # repeats are of one pose and one reflector
    seen = {(visit, *place) for visit, place in zip(joined.visit.tolist(), joined.target_P_mm.tolist(), strict=True)}
    assert len(seen) == len(set(joined.visit.tolist())) == 3 * POSES - 1


def test_a_column_of_visits_tells_repeats_apart(measured: Path) -> None:
    joined = read_recording(join(measured, "visits.csv", *with_places(), "--visit", "run"))
    assert joined.visit is not None
    assert len(set(joined.visit.tolist())) == joined.rows


def test_what_was_joined_calibrates(measured: Path) -> None:
    recording = join(measured, "learned.csv", *with_places(), "--sigma-um", str(1e3 * NOISE_MM))
    out = measured / "as-built.yaml"
    printed = run("calibrate", recording, "--out", out)
    assert out.exists(), printed
    fall = re.search(r"left out falls from ([\d.]+) to ([\d.]+) um", " ".join(printed.split()))
    assert fall, printed
    before_um, after_um = map(float, fall.groups())
    assert after_um < min(1.2 * 1e3 * NOISE_MM, before_um / 5), printed


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "several reflectors, and no place of any"),
        (["--reflector-place", "top=60,0,-15"], "left, right"),
        (["--reflector-place", "top=60,0"], "is not understood"),
        ([*with_places(), "--by", "time"], "joined at rest"),
    ],
)
def test_what_is_not_said_of_reflectors_is_asked(measured: Path, tmp_path: Path, options: list[str], said: str) -> None:
    arguments = ["recording", "join", measured / "log.csv", measured / "points.csv", tmp_path / "out.csv"]
    arguments += ["--machine", measured / "6-ups.yaml", "--log", "pose=point", "--by", "name", *options]
    failed = CliRunner().invoke(app, list(map(str, arguments)))
    assert failed.exit_code != 0
    assert said in str(failed.exception), failed.output
    assert list(tmp_path.iterdir()) == []
