"""Commands on a recording that is too long for the memory: all of them take its sample, and say so."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import compd
from compd.cli.measurements.compare import compare
from compd.cli.measurements.diagnose import diagnose
from compd.cli.measurements.model.effect import add, fit
from compd.comparison import is_long
from compd.comparison import open as open_module
from compd.model_file import read_model_file
from tests.support.measured import gauges, hidden, record

ROWS = 400

app = typer.Typer()
for command in (compare, diagnose, add, fit):
    app.command()(command)


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording that counts as long."""
    monkeypatch.setattr(open_module, "LONG_ROWS", 100)
    monkeypatch.setattr(open_module, "open_sample", partial(compd.open_sample, rows=150))
    return record(tmp_path, gauges(ROWS, 3), [hidden("link_expansion", 1.1)])


def run(*arguments: str | Path) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)
    assert result.exit_code == 0
    return result.stdout


def test_compare_takes_a_sample(recorded: Path) -> None:
    report = json.loads(run("compare", recorded, "--json"))
    drawn = compd.open_sample(recorded, rows=150)
    whole = compd.compare(compd.open_recording(recorded))
    assert report["sample"]["of"] == ROWS
    assert report["sample"]["rows"] == report["rows_used"] == drawn.recording.rows
    error_um = report["sample"]["residual_rms_standard_error_um"]
    assert abs(report["residual_rms_um"] - whole.rms_um) < 3 * error_um
    assert report["noise_floor_um"] == pytest.approx(whole.floor.um, rel=0.2)
    assert compd.compare(recorded).rms_um == report["residual_rms_um"]


@pytest.mark.long
@pytest.mark.sample
def test_compare_says_what_the_sample_leaves_uncertain(recorded: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    text = " ".join(run("compare", recorded, "--html", page).split())
    rows = compd.open_sample(recorded, rows=150).recording.rows
    for said in (text, page.read_text(encoding="utf-8")):
        assert f"{rows} of {ROWS} rows" in said
        assert "were compared: a sample. It adds a standard error of" in said
        assert "An event shorter than about" in said
        assert "standard errors of parameters are those of the sample" in said


@pytest.mark.long
def test_diagnose_takes_a_sample_and_says_so(recorded: Path) -> None:
    page = recorded.with_name("page.html")
    report = json.loads(run("diagnose", recorded, "--json", "--html", page))
    rows = compd.open_sample(recorded, rows=150).recording.rows
    assert (report["sample"]["rows"], report["sample"]["of"]) == (rows, ROWS)
    assert report["effects"][0]["effect"] == "link_expansion" if "effects" in report else True
    assert f"{rows} of {ROWS} rows" in page.read_text(encoding="utf-8")
    assert f"{rows} of {ROWS} rows" in " ".join(run("diagnose", recorded).split())


def test_a_file_that_cannot_be_counted_is_left_to_who_reads_it_whole(recorded: Path) -> None:
    assert is_long(recorded)
    assert not is_long(recorded.with_name("none.csv"))


@pytest.mark.long
def test_effects_are_fitted_to_the_sample(recorded: Path, tmp_path: Path) -> None:
    model = tmp_path / "run.model.yaml"
    rows = compd.open_sample(recorded, rows=150).recording.rows
    said = f"Fitted to {rows} of {ROWS} rows: a sample"
    assert said in run("add", "link_expansion", "--recording", recorded, "--model", model)
    (long,) = read_model_file(model, "tripod-cmm", 3).fitted
    (whole,) = compd.add_effect(None, "link_expansion", compd.open_recording(recorded)).fitted
    assert abs(long.theta[0] - whole.theta[0]) < 3 * np.sqrt(long.covariance[0, 0])
    assert long.covariance[0, 0] > whole.covariance[0, 0]
    assert said in run("fit", "--recording", recorded, "--model", model)
