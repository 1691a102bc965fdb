"""Encodings, line ends, and what is no text."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from compd.errors import RecordingError
from compd.instruments.read import read_export
from tests.unit.instruments.reading import read, refused

TEXT = "Zeit [s];Länge [µm]\n0,5;1,25\n1,0;2,5\n"


@pytest.mark.parametrize(
    ("content", "encoding"),
    [
        (TEXT.encode(), "UTF-8"),
        (b"\xef\xbb\xbf" + TEXT.encode(), "UTF-8 with a byte order mark"),
        (TEXT.encode("cp1252"), "Windows-1252, as it is no UTF-8"),
        (TEXT.encode("utf-16"), "UTF-16"),
        (b"\xfe\xff" + TEXT.encode("utf-16-be"), "UTF-16"),
        (TEXT.replace("\n", "\r\n").encode(), "UTF-8"),
        (TEXT.replace("\n", "\r").encode(), "UTF-8"),
        (TEXT.replace("\n", "\n\n  \n").encode() + b"\x1a", "UTF-8"),
    ],
)
def test_every_encoding_and_line_end_gives_the_same(tmp_path: Path, content: bytes, encoding: str) -> None:
    export = read(tmp_path, content)
    assert export.taken["encoding"] == encoding
    assert export.axes == ("length",)
    np.testing.assert_allclose(export.values[:, 0], [0.00125, 0.0025], rtol=1e-12)
    assert export.time_s is not None
    np.testing.assert_allclose(export.time_s, [0.5, 1.0])


def test_lines_are_those_of_the_file(tmp_path: Path) -> None:
    assert read(tmp_path, "# c\n\nx_mm,y_mm\n\n1,2\n\n# c\n3,4\n").line.tolist() == [5, 8]


@pytest.mark.parametrize(
    ("content", "wanted"),
    [
        (b"", "is empty"),
        (b"# nothing\n\n", "has no rows"),
        (b"x_mm,y_mm\n1,2\n3,\x004\n", "export.txt:3: is not text"),
        (b"x_mm,y_mm\n1,2\n\x81\x8d,4\n", "export.txt:3: is not text in any encoding"),
        ("x_mm,y_mm\n1,2\n".encode("utf-16")[:-1], "is not text in any encoding"),
        (b"\xd0\xcf\x11\xe0abc", "Excel workbook of before 2007"),
        (b"a,b\nc,d\n", "no row has a number"),
    ],
)
def test_what_is_no_table_of_text_is_refused(tmp_path: Path, content: bytes, wanted: str) -> None:
    assert wanted in refused(tmp_path, content)


def test_a_pipe_a_directory_and_a_missing_file_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name, wanted in (
        ("pipe", "cannot be read: it is not a regular file"),
        (".", "cannot be read: it is a directory"),
        ("none", "No such file"),
    ):
        with pytest.raises(RecordingError, match=wanted):
            read_export(tmp_path / name)
