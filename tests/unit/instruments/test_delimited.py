"""Delimiters, decimal marks, comments, headers and rows that are not like the others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.unit.instruments.reading import read, refused

POINTS = [[1.5, -2.25, 3.125], [10.5, 20.25, -30.125]]


@pytest.mark.parametrize(
    ("content", "delimiter", "said"),
    [
        ("x_mm,y_mm,z_mm\n1.5,-2.25,3.125\n10.5,20.25,-30.125\n", "comma", {}),
        ("x_mm;y_mm;z_mm\n1,5;-2,25;3,125\n10,5;20,25;-30,125\n", "semicolon", {}),
        ("x_mm\ty_mm\tz_mm\n1,5\t-2,25\t3,125\n10,5\t20,25\t-30,125\n", "tab", {}),
        ("x_mm|y_mm|z_mm\n1.5|-2.25|3.125\n10.5|20.25|-30.125\n", "pipe", {}),
        ("X [mm]  Y [mm]   Z [mm]\n   1.5  -2.25    3.125\n  10.5  20.25  -30.125\n", "blanks", {}),
        ("X [mm] Y [mm] Z [mm]\n1,5 -2,25 3,125\n10,5 20,25 -30,125\n", "blanks", {}),
        ("sep=;\nx_mm;y_mm;z_mm\n1,5;-2,25;3,125\n10,5;20,25;-30,125\n", "semicolon", {}),
        ("x_mm,y_mm,z_mm,\n1.5,-2.25,3.125,\n10.5,20.25,-30.125,\n", "comma", {}),
        ('"x_mm","y_mm","z_mm"\n"1,5","-2,25","3,125"\n"10,5","20,25","-30,125"\n', "comma", {}),
        ("% made by hand\n; and by an editor\nx_mm,y_mm,z_mm\n1.5,-2.25,3.125\n10.5,20.25,-30.125\n", "comma", {}),
        ("# x_mm y_mm z_mm\n1.5 -2.25 3.125\n10.5 20.25 -30.125\n", "blanks", {}),
        ("X;Y;Z\nmm;mm;mm\n1,5;-2,25;3,125\n10,5;20,25;-30,125\n", "semicolon", {}),
        ("# units: millimeters\nX;Y;Z\n1,5;-2,25;3,125\n10,5;20,25;-30,125\n", "semicolon", {}),
        ("Report of a Monday;;\nX mm;Y mm;Z mm\n1,5;-2,25;3,125\n10,5;20,25;-30,125\n", "semicolon", {}),
        ("1.5, -2.25, 3.125\n10.5, 20.25, -30.125\n", "comma", {"unit": "mm"}),
        ("0.15,-0.225,0.3125\n1.05,2.025,-3.0125\n", "comma", {"unit": "cm"}),
        ("1.500;-2.250;3.125\n10.500;20.250;-30.125\n", "semicolon", {"unit": "mm"}),
        ("1,500;-2,250;3,125\n10,500;20,250;-30,125\n", "semicolon", {"unit": "mm", "decimal": ","}),
        ("1.5e0 -2.25E0 3.125\n1.05e+1 20.25 -3012.5e-2\n", "blanks", {"unit": "mm"}),
    ],
)
def test_one_table_in_every_dress(tmp_path: Path, content: str, delimiter: str, said: dict[str, Any]) -> None:
    export = read(tmp_path, content, **said)
    assert export.axes == ("x", "y", "z")
    assert export.taken["delimiter"] == delimiter
    np.testing.assert_allclose(export.values, POINTS, rtol=1e-12)
    assert export.time_s is None


def test_marks_of_thousands_are_read_once_a_person_says_which_mark_is_decimal(tmp_path: Path) -> None:
    text = "x_mm;y_mm\n1.234,5;2\n-12.345.678,25;3\n"
    assert "marks of thousands" in refused(tmp_path, text)
    np.testing.assert_allclose(read(tmp_path, text, decimal=",").values, [[1234.5, 2], [-12345678.25, 3]])
    english = "x_mm;y_mm\n1,234;2,000\n"
    question = refused(tmp_path, english)
    assert "--decimal , (1.234)" in question
    assert "--decimal . (1234)" in question
    np.testing.assert_allclose(read(tmp_path, english, decimal=".").values, [[1234, 2000]])
    np.testing.assert_allclose(read(tmp_path, english, decimal=",").values, [[1.234, 2]])


@pytest.mark.parametrize(
    ("content", "wanted"),
    [
        ("x_mm,y_mm\n1,2\n3,4\n5\n", ["export.txt:4: has 1 cell where the others have 2", "cut off"]),
        ("x_mm,y_mm\n1,2\n3,4,5\n5,6\n", ["export.txt:3: has 3 cells where the others have 2"]),
        ("x_mm y_mm\n1 2\n3 4\n5 6 7\n", ["export.txt:4: has 3 cells"]),
        ("x_mm,y_mm\n1.250,2.250\n1.125,3.375\n1.250,4.2", ["export.txt:4: the last line seems to be cut off"]),
        ("x_mm,y_mm\n1,2\n3,4\nx_mm,y_in\n3,4\n", ["export.txt:4: another header begins here"]),
        ("1,2,3\n1,2,3\nx,y,z\n1,2,3\n", ["export.txt:3: a header stands between the rows"]),
        ("x_mm,y_mm\n1,2\n3,n/a\n", ["export.txt:3: column 2 'y_mm' is no number", "n/a"]),
        ("x_mm,y_mm\n1,2\n3,nan\n", ["export.txt:3: column 2 'y_mm' is no number"]),
        ("x_mm,y_mm\n1,2\n3,1e999\n", ["export.txt:3: column 2 'y_mm' is larger than anything measured"]),
        ("x_mm;y_mm\n1,5;2\n1.5;3\n", ["export.txt:3: a number has a point, where others have a decimal comma"]),
        ("x_mm;y_mm\n1,500;2\n1.5;3\n", ["export.txt:2: numbers have points and commas"]),
        ("a,b,c\n1,2,3,4\n1,2,3,5\n", ["export.txt:1: the line above the rows has 3 cells, the rows have 4"]),
        ("x_mm,y_mm\n1,\n,4\n", ["no row is complete"]),
        ("# unit: mm\n# unit: inch\nx,y\n1,2\n", ["export.txt:2: comments name two units"]),
    ],
)
def test_odd_rows_are_refused_with_their_line(tmp_path: Path, content: str, wanted: list[str]) -> None:
    message = refused(tmp_path, content)
    for part in wanted:
        assert part in message


def test_the_same_header_again_is_skipped_and_counted(tmp_path: Path) -> None:
    export = read(tmp_path, "x;y\nmm;mm\n1;2\nx;y\nmm;mm\n3;4\n")
    assert export.line.tolist() == [3, 6]
    assert export.left_out == {"the header again": 2}


def test_a_last_line_without_an_end_is_whole_where_decimals_vary(tmp_path: Path) -> None:
    assert len(read(tmp_path, "x_mm,y_mm\n1.250,2.25\n1.125,3.375\n1.250,4.2").line) == 3


def test_rows_with_an_empty_cell_are_counted(tmp_path: Path) -> None:
    export = read(tmp_path, "name,x_mm,y_mm\nP1,1,\nP2,3,4\n,,\nP3,,\n")
    assert export.name == ("P2",)
    assert export.line.tolist() == [3]
    assert export.left_out == {"with an empty cell": 2}


def test_a_row_of_units_may_name_any_unit(tmp_path: Path) -> None:
    for units in ("[µm];[µm];[µm];°C", "mm;mm;mm;hPa", "mm;mm;mm;-"):
        text = f"X;Y;Z;T\n{units}\n1;2;3;20\n2;3;5;21\n3;5;4;20\n"
        assert read(tmp_path, text, columns=["x", "y", "z", "-"]).line.tolist() == [3, 4, 5]
