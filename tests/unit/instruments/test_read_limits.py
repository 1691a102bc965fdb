"""How much an export may hold: refused before it is split into cells, with what is allowed."""

from __future__ import annotations

from typing import Any
from unittest.mock import Mock

import pytest

from compd.errors import RecordingError
from compd.instruments.export import ReadOptions
from compd.instruments.preview import preview_export
from compd.instruments.read import read_export
from compd.instruments.read_limits import ReadLimits
from compd.page.joining.choices import LIMITS as OF_THE_PAGE

TABLE = "x,y,z\n1.5,2.5,3.5\n4.5,5.5,6.5\n7.5,8.5,9.5\n"


def refused(path: Any, **limits: int) -> str:
    options = ReadOptions(limits=ReadLimits(**limits))
    with pytest.raises(RecordingError) as caught:
        read_export(path, options)
    assert preview_export(path, options).export is None
    return str(caught.value)


@pytest.mark.parametrize(
    ("limits", "what", "allowed"),
    [
        ({"lines": 3}, "too many lines", "allowed: 3"),
        ({"line_characters": 10}, "too long for a row", "allowed: 10 in a line"),
        ({"columns": 2}, "too many columns", "allowed: 2 in a line"),
        ({"cells": 11}, "4 rows of 3 cells, 12 together", "allowed: 11 cells"),
    ],
)
@pytest.mark.parametrize("between", [",", " ", "\t", "   "])
def test_more_than_is_allowed_is_refused_with_what_to_do(
    tmp_path: Any, limits: dict[str, int], what: str, allowed: str, between: str
) -> None:
    path = tmp_path / "table.txt"
    path.write_text(TABLE.replace(",", between))
    message = refused(path, **limits)
    assert what in message
    assert allowed in message
    assert "next:" in message


def test_just_as_much_as_is_allowed_is_read(tmp_path: Any) -> None:
    path = tmp_path / "table.csv"
    path.write_text(TABLE)
    limits = ReadLimits(lines=4, line_characters=12, columns=3, cells=12)
    assert len(read_export(path, ReadOptions(limits=limits, unit="mm")).line) == 3


def test_one_line_of_many_cells_is_refused_at_once(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("find_delimiter", "split_cells"):
        monkeypatch.setattr(f"compd.instruments.delimited.{name}", Mock(side_effect=AssertionError("it is split")))
    path = tmp_path / "line.csv"
    path.write_text("1," * 2_000_000)
    assert "4000000 characters" in refused(path)
    path.write_text(TABLE)
    with pytest.raises(AssertionError, match="it is split"):
        read_export(path, ReadOptions())


def test_the_page_allows_less_than_a_command(tmp_path: Any) -> None:
    own = ReadLimits()
    for name in ("lines", "cells", "sheet_cells", "unpacked_bytes"):
        assert getattr(OF_THE_PAGE, name) < getattr(own, name)
