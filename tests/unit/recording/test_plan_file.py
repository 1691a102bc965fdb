"""The file of a planned measurement: what is written is what is read."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from compd.errors import CompdError, Problem, RecordingError
from compd.plan_file import SPEED_COLUMN, plan_row, plan_text, read_plan_file, write_text_file

LIMITS = {"force_x_N": (-100.0, 100.0), SPEED_COLUMN: (0.0, 50.0)}
ROWS = [
    {"row": 1, **plan_row("a load, straight", 0.04, np.array([1.23456, 0, 190]), {"force_x_N": 50}, np.ones(3), 0)},
    {"row": 2, **plan_row("a pass", 12.06, np.array([0, -5, 190]), {"force_x_N": 0}, np.array([1, -1, 0]), 9.999)},
]


def test_a_plan_is_rounded_to_what_a_person_can_set() -> None:
    header, first, second = plan_text(ROWS).splitlines()
    assert header.split(",")[:4] == ["row", "purpose", "time_s", "tip_x_mm"]
    assert first == '1,"a load, straight",0.0,1.235,0.0,190.0,50.0,1,1,1,0.0'
    assert second == "2,a pass,12.1,0.0,-5.0,190.0,0.0,1,-1,0,10.0"


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "next.csv"
    write_text_file(path, plan_text(ROWS))
    problems: list[Problem] = []
    file = read_plan_file(path, 3, LIMITS, problems)
    assert problems == []
    assert [(line.line, line.purpose) for line in file.lines] == [(2, "a load, straight"), (3, "a pass")]
    for line, row in zip(file.lines, ROWS, strict=True):
        assert line.values == {name: value for name, value in row.items() if name not in ("row", "purpose")}


def test_a_wrong_cell_is_a_problem_and_not_a_number(tmp_path: Path) -> None:
    path = tmp_path / "next.csv"
    write_text_file(
        path, plan_text([{**ROWS[0], "force_x_N": 101, "approach_2": 0.5, "tip_y_mm": "", SPEED_COLUMN: 51}])
    )
    problems: list[Problem] = []
    (line,) = read_plan_file(path, 3, LIMITS, problems).lines
    assert [problem.where.rpartition(" ")[2] for problem in problems] == [
        "tip_y_mm",
        "force_x_N",
        "approach_2",
        SPEED_COLUMN,
    ]
    assert all(problem.where.startswith(f"{path}:2 column ") for problem in problems)
    assert all(math.isnan(line.values[name]) for name in ("tip_y_mm", "force_x_N", "approach_2", SPEED_COLUMN))
    assert line.values["tip_x_mm"] == 1.235


def test_a_spreadsheets_number_is_told_as_in_a_recording(tmp_path: Path) -> None:
    path = tmp_path / "next.csv"
    rows = 'purpose,time_s,tip_x_mm,tip_y_mm,tip_z_mm\n7,0,"1,25",0,190\n,1,#N/A,0,190\n'
    write_text_file(path, rows)
    problems: list[Problem] = []
    lines = read_plan_file(path, 3, LIMITS, problems).lines
    assert [(line.line, line.purpose) for line in lines] == [(2, "7"), (3, "")]
    whats = {problem.what: problem.where for problem in problems}
    assert whats["decimal comma"] == f"{path}: column tip_x_mm (C), row 2"
    assert whats["a spreadsheet's error"] == f"{path}: column tip_x_mm (C), row 3"


def test_a_column_of_another_machine_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "next.csv"
    write_text_file(path, plan_text(ROWS))
    problems: list[Problem] = []
    read_plan_file(path, 2, {SPEED_COLUMN: (0.0, 50.0)}, problems)
    assert [problem.value for problem in problems] == ["force_x_N", "approach_3"]


def test_a_place_that_cannot_be_written_or_read_is_named(tmp_path: Path) -> None:
    path = tmp_path / "nowhere" / "next.csv"
    with pytest.raises(RecordingError, match="cannot be written"):
        write_text_file(path, plan_text(ROWS))
    with pytest.raises(CompdError, match="cannot be read"):
        read_plan_file(path, 3, LIMITS, [])
