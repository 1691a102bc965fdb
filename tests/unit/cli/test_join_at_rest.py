"""`compd recording join` of points without time: nothing is joined by order or by name that nobody asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import Result
from typer.testing import CliRunner

from compd.arrays import FloatArray
from compd.cli.app import app
from compd.errors import RecordingError
from compd.recording import read_recording
from tests.support.points_at_rest import in_own_frame
from tests.unit.joining.test_at_rest import one_row_per_place

PLACES = 12


@pytest.fixture
def tip_mm(tmp_path: Path) -> FloatArray:
    """(PLACES, 3) where the tip was in the recording gauges.csv."""
    return one_row_per_place(tmp_path, np.random.default_rng(1), PLACES).tip_mm


def listed(path: Path, tip_mm: FloatArray, head: str = "", row: str = "P{number:03d} {x:.5f} {y:.5f} {z:.5f}") -> Path:
    own_mm = in_own_frame(tip_mm)
    rows = [row.format(number=k, x=x, y=y, z=z, minute=2 * k) for k, (x, y, z) in enumerate(own_mm, start=1)]
    path.write_text("\n".join([*head.splitlines(), *rows]) + "\n", encoding="utf-8")
    return path


def join(export: Path, *words: str) -> Result:
    gauges, out = export.with_name("gauges.csv"), export.with_name("joined.csv")
    return CliRunner().invoke(app, ["recording", "join", str(gauges), str(export), str(out), *words])


def refusal(result: Result) -> str:
    assert isinstance(result.exception, RecordingError), result.output
    return str(result.exception)


def test_points_without_time_are_joined_as_a_person_says(tmp_path: Path, tip_mm: FloatArray) -> None:
    export = listed(tmp_path / "points.txt", tip_mm)
    text = refusal(join(export, "--unit", "mm"))
    assert "has no times" in text
    assert "--by order" in text
    assert "--by name" in text
    result = join(export, "--unit", "mm", "--by", "order")
    assert result.exit_code == 0, result.output
    assert "joined by order: 12 of 12 points, 12 dwells of the machine" in result.output
    assert "distances between points agree with the machine's to " in result.output
    assert read_recording(tmp_path / "joined.csv").rows == PLACES


SPATIAL_ANALYZER = (
    "// SpatialAnalyzer SA 2024.2 ( x64 )\n// Points Relative to Coordinate Frame 'A::WORLD'\n"
    "// AXES = CARTESIAN: X,  Y,  Z (mm)"
)


def test_stamps_of_points_at_rest_are_no_track(tmp_path: Path, tip_mm: FloatArray) -> None:
    row = "A, P, P{number}, {x:.5f}, {y:.5f}, {z:.5f}, 11/22/26 16:{minute:02d}:05"
    export = listed(tmp_path / "points.txt", tip_mm, SPATIAL_ANALYZER, row)
    assert "no track in time" in refusal(join(export))
    result = join(export, "--by", "name")
    assert result.exit_code == 0, result.output
    assert "joined by name: 12 of 12 points" in result.output


def test_a_point_that_was_forgotten_and_one_beside_it_are_told(tmp_path: Path, tip_mm: FloatArray) -> None:
    strange_mm = np.insert(np.delete(tip_mm, 4, axis=0), 8, [500.0, 0.0, 0.0], axis=0)
    result = join(listed(tmp_path / "points.txt", strange_mm), "--unit", "mm", "--by", "order")
    assert result.exit_code == 0, result.output
    assert "dwells without a point: 5" in result.output
    assert "points of no dwell" in result.output
    assert "line 9" in result.output


def test_points_in_any_order_are_joined_by_their_distances(tmp_path: Path, tip_mm: FloatArray) -> None:
    export = listed(tmp_path / "points.txt", tip_mm[::-1])
    assert "--by distance" in refusal(join(export, "--unit", "mm"))
    result = join(export, "--unit", "mm", "--by", "distance")
    assert result.exit_code == 0, result.output
    assert "joined by distance: 12 of 12 points" in result.output
    assert "line 1: dwell 12" in result.output


@pytest.mark.parametrize(
    "words", [("--by", "order", "--moving"), ("--by", "name", "--offset", "1"), ("--by", "order", "--plan", "p")]
)
def test_options_that_do_not_go_together(tmp_path: Path, tip_mm: FloatArray, words: tuple[str, ...]) -> None:
    result = join(listed(tmp_path / "points.txt", tip_mm), "--unit", "mm", *words)
    assert result.exit_code == 2
    assert "contradicts --by" in result.output
    assert not (tmp_path / "joined.csv").exists()


def test_the_machine_is_found_by_its_name_or_given(tmp_path: Path, tip_mm: FloatArray) -> None:
    export = listed(tmp_path / "points.txt", tip_mm)
    (tmp_path / "gauges.yaml").write_text("machine: mine\n")
    assert "no configuration of this machine" in refusal(join(export, "--unit", "mm", "--by", "order"))
