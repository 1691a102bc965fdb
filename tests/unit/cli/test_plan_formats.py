"""`compd plan --as`: targets for the instrument and a programme for the controller, from a recording."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from compd.cli.app import app
from compd.errors import CompdError
from compd.files import check_replaceable
from compd.planning import MARKS
from compd.planning.plan_formats import target_name
from compd.simulation import Mechanism
from tests.support.hidden_effects import record_with_effects
from tests.support.simulated import tripod
from tests.unit.instruments.test_gcode import COMMENT, WORDS


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plan") / "run.csv"
    record_with_effects(path, 1, {"link_elasticity": (1 / 60,)})
    return path


def planned(recording: Path, out: Path, *options: str) -> Result:
    arguments = ["plan", str(recording), "--rivals", "link_elasticity,joint_contact", "--rows", "12", "--force", "100"]
    return CliRunner().invoke(app, [*arguments, "--out", str(out), *options])


@pytest.fixture(scope="module")
def files(recording: Path) -> dict[str, Path]:
    """The same plan in every format."""
    options = {"plan": (), "sa": (), "csv": (), "gcode": ("--feed", "900")}
    written = {shape: recording.parent / f"next-{shape}" for shape in options}
    for shape, out in written.items():
        result = planned(recording, out, "--as", shape, *options[shape])
        assert result.exit_code == 0, result.output
    return written


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_targets_are_the_rows_of_the_plan_under_their_names(files: dict[str, Path]) -> None:
    rows, listed = rows_of(files["plan"]), rows_of(files["csv"])
    points = [line.split(",  ") for line in files["sa"].read_text().splitlines()[3:]]
    assert len(rows) == len(points) == len(listed)
    for row, point, target in zip(rows, points, listed, strict=True):
        assert point[2] == target["name"] == target_name(int(row["row"]))
        places = [[float(row[f"tip_{axis}_mm"]) for axis in "xyz"], [float(target[f"{axis}_mm"]) for axis in "xyz"]]
        assert places[0] == places[1] == [float(cell) for cell in point[3:]]
        assert float(target["force_z_N"]) == float(row["force_z_N"])


def test_the_programme_comes_to_every_place_from_the_side_of_the_plan(files: dict[str, Path]) -> None:
    rows, lines = rows_of(files["plan"]), files["gcode"].read_text().splitlines()
    assert all(line == "" or COMMENT.fullmatch(line) or WORDS.fullmatch(line) for line in lines)
    mechanism = Mechanism(tripod())
    moves = [np.array([float(word[1:]) for word in line.split()[1:4]]) for line in lines if line.startswith("G1 ")]
    assert len(moves) == 2 * len(rows)
    for row, via_M_mm, place_M_mm in zip(rows, moves[::2], moves[1::2], strict=True):
        np.testing.assert_allclose(place_M_mm, [float(row[f"tip_{axis}_mm"]) for axis in "xyz"], atol=1e-9)
        before, after = (mechanism.lengths(mechanism.posture_at(tip, np.zeros(3))) for tip in (via_M_mm, place_M_mm))
        assert np.sign(after - before).tolist() == [float(row[f"approach_{i}"]) for i in (1, 2, 3)]


def test_a_programme_needs_a_feed(recording: Path, tmp_path: Path) -> None:
    result = planned(recording, tmp_path / "next.ngc", "--as", "gcode")
    assert isinstance(result.exception, CompdError)
    assert "--feed" in str(result.exception)
    assert not (tmp_path / "next.ngc").exists()


def test_one_kind_of_file_is_not_written_over_another(recording: Path, files: dict[str, Path]) -> None:
    marks = {"plan": b"purpose,", **MARKS}
    for shape, path in files.items():
        check_replaceable(path, (marks[shape],), "a plan")
        for other in set(marks) - {shape}:
            with pytest.raises(CompdError, match="is there already"):
                check_replaceable(path, (marks[other],), "a plan")
    # the command asks so before it computes anything
    assert isinstance(planned(recording, files["sa"]).exception, CompdError)
