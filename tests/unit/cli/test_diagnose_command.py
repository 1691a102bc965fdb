"""`compd diagnose` as a person types it: twelve lines, a line, the evidence, and what can be pasted from it."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
import typer
import yaml
from rich.console import Console
from typer.testing import CliRunner

from compd.cli.measurements.diagnose import diagnose
from compd.diagnosis import WIDTH, CandidateResult, Diagnosis, summary_lines
from compd.diagnosis.findings import UntestedEffect
from compd.diagnosis.words.summary_lines import MAX_LINES
from compd.model.library import find_effect
from compd.report import print_diagnosis
from tests.support.diagnoses import (
    FRAME,
    Noise,
    described_by_two,
    description,
    diagnosis,
    external_recording,
    formula,
    step,
)
from tests.support.measured import gauges, hidden, record

app = typer.Typer()
app.command()(diagnose)


def printed(made: Diagnosis, width: int = 80) -> str:
    """What a terminal of so many columns shows."""
    out = io.StringIO()
    print_diagnosis(Console(file=out, width=width, highlight=False), made, [])
    return out.getvalue()


def described() -> Diagnosis:
    vary = {"measure": "vary temperature_frame_degC alone", "why": "the rest follows it"}
    return described_by_two("A description, not a cause.", next_measurement=[vary])


@pytest.fixture(scope="module")
def output(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    path = record(tmp_path_factory.mktemp("run"), gauges(300, 21), [hidden("link_expansion", 1.1)])
    result = CliRunner().invoke(app, [str(path)], catch_exceptions=False)
    assert result.exit_code == 0
    return path, result.stdout


def test_it_begins_with_the_twelve_lines_and_a_line(output: tuple[Path, str]) -> None:
    lines = output[1].split("\n")
    end = lines.index("-" * WIDTH)
    assert 3 <= end <= MAX_LINES
    assert max(map(len, lines[:end])) <= WIDTH
    assert lines[0].startswith("identified: What is missing is link_expansion: ")
    assert lines[1].startswith("Found:    link_expansion: the rods between joints and scale grow with")


def test_the_evidence_has_equation_numbers_share_and_rivals(output: tuple[Path, str]) -> None:
    evidence = output[1].partition("-" * WIDTH)[2]
    assert "1. link_expansion: The rods between joints and scale grow with temperature." in evidence
    for begin in (
        "equation ",
        "a ",
        "error, rows left out ",
        "explains ",
        "by noise alone ",
        "rivals ",
        "told apart by ",
    ):
        assert f"\n    {begin}" in evidence
    assert "Without gain:" in evidence


def test_json_has_the_sentence(output: tuple[Path, str]) -> None:
    result = CliRunner().invoke(app, [str(output[0]), "--json"], catch_exceptions=False)
    assert json.loads(result.stdout)["said"].startswith("What is missing is link_expansion: with it the error of ")


def test_formulas_pasted_from_the_terminal_are_a_file_of_effects() -> None:
    lines = printed(described()).split("\n")
    first = next(k for k, line in enumerate(lines) if line.startswith("- id:"))
    last = max(k for k, line in enumerate(lines) if "# fitted:" in line)
    entries = yaml.safe_load("\n".join(lines[first : last + 1]))
    assert [find_effect(entry, "pasted").id for entry in entries] == [
        f"reference_follows_{name.lower()}_linear_x" for name in FRAME
    ]
    assert f"compd model add described.yaml:{entries[0]['id']} --recording stage.csv --model FILE" in lines


def test_what_to_vary_is_said_once() -> None:
    text = printed(described())
    assert "    vary temperature_frame_degC alone: the rest follows it" in text
    assert "measure vary" not in text
    assert "measure measure" not in text


def test_a_machine_with_a_model_of_its_own_is_told_of_nothing_inside_another() -> None:
    play = formula("stage_backlash", "b * moved_1", "Play of screw and coupling.")
    candidates = [CandidateResult("my_bow", "no_gain", "takes 0 % of the error away")]
    untested = [UntestedEffect("link_sag", "acts inside a machine"), UntestedEffect("my_growth", "needs humidity_pct")]
    fields = {"steps": [step(play, [0.6], 0.02, 0.3, links=0)], "candidates": candidates, "untested": untested}
    text = printed(diagnosis("identified", 1.4, 0.3, Noise(0.29), external_recording(), **fields))
    assert "link_sag" not in text
    assert "my_growth  needs humidity_pct" in text
    assert "my_bow" in text


@pytest.mark.parametrize("width", [40, 80, 200])
def test_the_lines_are_the_same_in_every_terminal(width: int) -> None:
    assert printed(described(), width).split("\n")[: len(summary_lines(described()))] == summary_lines(described())


def test_a_long_description_leaves_room_for_the_other_columns() -> None:
    changed = description(FRAME[0], "linear", 5.5, 0.998, beside=("temperature_room_degC", "temperature_spindle_degC"))
    text = printed(diagnosis("unexplained", 115.0, 115.0, Noise(1.1), external_recording("x"), depends_on=[changed]))
    head = next(line for line in text.split("\n") if "follows" in line and "form" in line)
    assert "explains" in head
