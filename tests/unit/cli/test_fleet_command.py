"""`compd fleet` as a person types it, as far as it needs no cluster."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from compd.cli.measurements.fleet import fleet
from compd.errors import CompdError
from compd.fleet import write_table
from tests.support.fleets import machine, result

PROBLEM = "lost.csv: cannot be read\n    next: copy it again"


def run(*arguments: object) -> str:
    """The output of a command that must succeed."""
    done = CliRunner().invoke(fleet, [str(argument) for argument in arguments], catch_exceptions=False)
    assert done.exit_code == 0
    return done.output


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "fleet.parquet"
    write_table(path, [*machine("tripod-01", [1.0, 1.2, 1.4]), result("tripod-02", problem=PROBLEM)])
    return path


def test_a_report_of_a_table(table: Path, tmp_path: Path) -> None:
    output = run("report", table, "--html", tmp_path / "fleet.html")
    assert (
        "3 recordings of 1 machine examined; 1 other could not be. 1 machine has an effect and 1 parameter drifts."
    ) in output
    assert "tripod-01: link_expansion.a changes by 0.400" in output
    assert "not examined: lost.csv: cannot be read\n" in output
    assert "copy it again" in (tmp_path / "fleet.html").read_text(encoding="utf-8")


def test_nothing_else_is_written_over(table: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.html").write_text("mine")
    with pytest.raises(CompdError, match="is there already"):
        run("report", table, "--html", tmp_path / "notes.html")
    run("report", table, "--html", tmp_path / "notes.html", "--overwrite")
    (tmp_path / "other.parquet").write_text("mine")
    with pytest.raises(CompdError, match="is there already"):
        run("compare", tmp_path, "--out", tmp_path / "other.parquet")


def test_a_place_without_recordings_is_said_before_a_cluster_is_started(tmp_path: Path) -> None:
    with pytest.raises(CompdError, match="has no recording"):
        run("diagnose", tmp_path, "--out", tmp_path / "fleet.parquet")
