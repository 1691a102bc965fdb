"""`compd compare` and `compd diagnose` of a recording that is too long for the memory."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import compd
from compd.cli.measurements.compare import compare
from compd.cli.measurements.diagnose import diagnose
from compd.cli.measurements.model.effect import add, fit
from compd.comparison import draw_sample
from compd.comparison.stream import recording_stream
from compd.model_file import read_model_file
from tests.support.measured import gauges, hidden, record

ROWS = 400

app = typer.Typer()
for command in (compare, diagnose, add, fit):
    app.command()(command)


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording that counts as long."""
    monkeypatch.setattr(recording_stream, "LONG_ROWS", 100)
    return record(tmp_path, gauges(ROWS, 3), [hidden("link_expansion", 1.1)])


def run(*arguments: str | Path) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)
    assert result.exit_code == 0
    return result.stdout


def test_compare_goes_through_it_in_blocks(recorded: Path) -> None:
    report = json.loads(run("compare", recorded, "--json"))
    assert report["rows"] == report["rows_used"] == ROWS
    assert report["sample"]["rows"] == ROWS
    assert report["largest_row_xyz"].keys() == {"x", "y", "z"}


@pytest.mark.long
@pytest.mark.sample
def test_compare_says_what_rests_on_the_sample(recorded: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    text = " ".join(run("compare", recorded, "--html", page).split())
    assert f"{ROWS} rows of {ROWS}, spread evenly" in text
    written = page.read_text(encoding="utf-8")
    assert "spread evenly" in written
    assert "Residual over time" in written
    assert f"lines are means over all {ROWS} rows of the sample" in written
    assert "means over all rows" not in written


@pytest.mark.long
def test_diagnose_takes_a_sample_and_says_so(recorded: Path) -> None:
    page = recorded.with_name("page.html")
    assert json.loads(run("diagnose", recorded, "--json", "--html", page))["sample"] == {"rows": ROWS, "of": ROWS}
    assert f"a sample of {ROWS} rows of {ROWS}, spread evenly" in page.read_text(encoding="utf-8")


def test_a_file_that_cannot_be_counted_is_left_to_who_reads_it_whole(recorded: Path) -> None:
    assert recording_stream.is_long(recorded)
    assert not recording_stream.is_long(recorded.with_name("none.csv"))


@pytest.mark.long
def test_effects_are_fitted_to_all_rows(recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(draw_sample, "__defaults__", (100, *(draw_sample.__defaults__ or ())[1:]))
    model = tmp_path / "run.model.yaml"
    assert f"Fitted to {ROWS} rows" in run("add", "link_expansion", "--recording", recorded, "--model", model)
    (long,) = read_model_file(model, "tripod-cmm", 3).fitted
    (whole,) = compd.add_effect(None, "link_expansion", compd.open_recording(recorded)).fitted
    # the sample's noise floor, by which coordinates are weighed, is another
    assert abs(long.theta[0] - whole.theta[0]) < 0.3 * np.sqrt(whole.covariance[0, 0])
    np.testing.assert_allclose(long.covariance, whole.covariance, rtol=0.2)
    run("fit", "--recording", recorded, "--model", model)
    (again,) = read_model_file(model, "tripod-cmm", 3).fitted
    assert again.theta[0] == pytest.approx(long.theta[0], rel=1e-4)
