"""`compd diagnose --effects`: effects of one's own beside the library's."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from compd.cli.measurements.diagnose import diagnose
from compd.errors import CompdError
from tests.support.measured import gauges, hidden, record

app = typer.Typer()
app.command()(diagnose)
SWELLING = """\
effects:
- {id: room_growth, port: link, formula: "k * (temperature_room_degC - 20)",
   parameters: {k: {unit: um/K, plausible: [-9, 9], source: notes}}}
"""


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return record(tmp_path, gauges(200, 21), [hidden("link_expansion", 1.1)])


def test_effects_of_files_are_tried_beside_the_library(recording: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(SWELLING)
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "base.yaml").write_text(SWELLING.replace("room", "base"))
    arguments = [
        str(recording),
        "--effects",
        str(tmp_path / "mine.yaml"),
        "--effects",
        str(tmp_path / "more"),
        "--json",
    ]
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    names = {candidate["effect"] for candidate in json.loads(result.stdout)["candidates"]}
    assert {"room_growth", "base_growth", "link_expansion"} <= names


def test_what_is_wrong_in_a_file_is_said_before_the_search(recording: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(SWELLING.replace("port: link", "port: link, axis: x"))
    result = CliRunner().invoke(app, [str(recording), "--effects", str(tmp_path / "mine.yaml")])
    assert isinstance(result.exception, CompdError)
    (problem,) = result.exception.problems
    assert problem.where == f"{tmp_path / 'mine.yaml'}:2 effects[1], axis"
