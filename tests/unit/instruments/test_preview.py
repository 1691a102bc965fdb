"""The top of an export as a person checks it: cells, meanings, choices, and problems beside what could be read."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from compd.instruments.export import ReadOptions
from compd.instruments.preview import SHOWN_ROWS, preview_export
from compd.instruments.read import read_export
from compd.instruments.samples import Samples
from tests.support.instrument_files import write_export

START = datetime(2026, 11, 22, 9, 15, 30)


def written(tmp_path: Path, name: str, text: str) -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("shape", ["csv", "german", "sa", "xlsx", "carto"])
def test_the_first_rows_of_every_shape_are_shown_with_their_meaning(tmp_path: Path, shape: str) -> None:
    axes = ("length",) if shape == "carto" else ("x", "y", "z")
    values = np.random.default_rng(1).uniform(-900, 900, (50, len(axes)))
    options = ReadOptions(unit="mm") if shape == "carto" else ReadOptions()
    path = write_export(tmp_path, shape, Samples(axes, values, time_s=np.arange(50) / 4.0, start=START))
    preview, export = preview_export(path, options), read_export(path, options)
    assert preview.problems == ()
    assert preview.export is not None
    np.testing.assert_array_equal(preview.export.values, export.values)
    assert len(preview.rows) == len(preview.line) == SHOWN_ROWS
    assert list(preview.line) == export.line[:SHOWN_ROWS].tolist()
    if shape == "carto":
        assert preview.roles == ()
        assert list(preview.header) == ["time [s]", "length [mm]"]
        return
    assert [role for role in preview.roles if role in axes] == list(axes)
    place = [list(preview.roles).index(axis) for axis in axes]
    shown = [[float(row[k]) for k in place] for row in preview.rows]
    np.testing.assert_allclose(shown, values[:SHOWN_ROWS], atol=1e-3)


def test_a_question_leaves_the_table_and_what_is_known_of_it(tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "t_s,x,y,z\n0.5,1.5,2.5,3.5\n1.0,4.5,5.5,6.5\n")
    preview = preview_export(path, ReadOptions())
    assert preview.export is None
    assert "no unit of x" in str(preview.problems[0])
    assert list(preview.roles) == ["time", "x", "y", "z"]
    assert preview.rows[1][3] == "6.5"
    assert preview.assumed["delimiter"] == "comma"


def test_lines_that_are_no_table_are_shown_as_they_are(tmp_path: Path) -> None:
    path = written(tmp_path, "a.csv", "x_mm,y_mm\n1.5,2.5\n3.5\n" + "4.5,5.5\n" * 40)
    preview = preview_export(path, ReadOptions())
    assert preview.export is None
    assert list(preview.rows[2]) == ["3.5"]
    assert (list(preview.line)[-1], len(preview.rows)) == (SHOWN_ROWS, SHOWN_ROWS)
    assert "has 1 cell" in str(preview.problems[0])


def test_groups_are_those_of_the_whole_file_also_when_one_is_chosen(tmp_path: Path) -> None:
    rows = "".join(f"{'A' if k % 2 else 'B'},P{k},{k}.5,2.5,3.5\n" for k in range(30))
    path = written(tmp_path, "a.csv", f"group,name,x_mm,y_mm,z_mm\n{rows}")
    asked = preview_export(path, ReadOptions())
    assert asked.export is None
    assert list(asked.groups) == ["B", "A"]
    chosen = preview_export(path, ReadOptions(group="A"))
    assert chosen.export is not None
    assert len(chosen.export.line) == 15
    assert list(chosen.groups) == ["B", "A"]


def test_the_sheets_of_a_workbook_can_be_chosen_from(tmp_path: Path) -> None:
    from openpyxl import Workbook

    book = Workbook()
    for title in ("first", "second"):
        sheet = book.create_sheet(title)
        sheet.append(["x_mm", "y_mm", "z_mm"])
        sheet.append([1.5, 2.5, 3.5])
    path = tmp_path / "two.xlsx"
    book.save(path)
    asked = preview_export(path, ReadOptions())
    assert asked.export is None
    assert "2 sheets hold numbers" in str(asked.problems[0])
    assert list(asked.sheets)[1:] == ["first", "second"]
    assert preview_export(path, ReadOptions(sheet="second")).export is not None


NO_EXPORTS = [b"", bytes(range(256)), b"PK\x03\x04 no workbook", b"HEADER::\r\nnothing", b"\xff\xfe\x00"]


@pytest.mark.parametrize("content", NO_EXPORTS)
def test_what_is_no_export_is_a_problem_and_no_more(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(content)
    preview = preview_export(path, ReadOptions())
    assert preview.export is None
    assert preview.problems
