"""CARTO .rtx by its description: read with a unit and a rate, refused where anything of it is missing or wrong."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from compd.errors import RecordingError
from compd.instruments.export import ReadOptions
from compd.instruments.formats.carto.reader import read_carto

HEADER = (
    "HEADER::",
    "Owner: A. Person",
    "Version no: 1",
    "File Type: Dynamic",
    "Velocity: 0.5",
    "Sample rate: 50",
    "Sample no: 3",
    "Trigger point: 0",
    "Trigger interval: 0",
    "Actual sample rate: 50.5",
    "TITLE::",
    "Machine: a machine: the second",
    "Serial No: 17",
    "Date: 10/02/2025 12:58:22",
    "By: A. Person",
    "Axis: Z",
    "Location: room 3",
    "Flags: 1 0 0 4",
    "Data:",
)
LENGTHS = (0.25, -1.5, 3.0625)
IN_MM = ReadOptions(unit="mm")


def rtx(header: tuple[str, ...] = HEADER, values: tuple[float, ...] = LENGTHS, end: bytes = b"EOF::\r\n") -> bytes:
    """The file, made without the writer."""
    text = "".join(f"{line}\r\n" for line in header).encode("ascii")
    return text + b"".join(struct.pack("<d", value) for value in values) + end


def without(*keys: str) -> tuple[str, ...]:
    return tuple(line for line in HEADER if not line.startswith(keys))


def changed(key: str, value: str) -> tuple[str, ...]:
    return tuple(f"{key}: {value}" if line.startswith(f"{key}:") else line for line in HEADER)


def written(tmp_path: Path, content: bytes) -> Path:
    path = tmp_path / "link.rtx"
    path.write_bytes(content)
    return path


def problems_of(tmp_path: Path, content: bytes, options: ReadOptions = IN_MM) -> str:
    with pytest.raises(RecordingError) as caught:
        read_carto(written(tmp_path, content), options)
    return str(caught.value)


def test_lengths_times_and_sample_numbers(tmp_path: Path) -> None:
    export = read_carto(written(tmp_path, rtx()), ReadOptions(unit="um"))
    assert (export.shape, export.axes, export.name, export.time_std_s) == ("carto", ("length",), None, 0.0)
    np.testing.assert_allclose(export.values, [[0.25e-3], [-1.5e-3], [3.0625e-3]], rtol=1e-15)
    np.testing.assert_allclose(export.time_s, [0.0, 1 / 50.5, 2 / 50.5], rtol=1e-15)
    assert export.line.tolist() == [1, 2, 3]


def test_it_says_what_was_taken_and_that_no_real_file_was_tried(tmp_path: Path) -> None:
    taken = read_carto(written(tmp_path, rtx()), IN_MM).taken
    assert "no file of an instrument was tried" in taken["format"]
    assert taken["length"] == "3 numbers behind `Data:`, mm by --unit"
    assert taken["time"] == "from 0, 50.5 samples per second by `Actual sample rate`"
    assert "10/02/2025 12:58:22" in taken["date"]


def test_a_rate_that_a_person_gives_is_taken_and_the_other_told(tmp_path: Path) -> None:
    export = read_carto(written(tmp_path, rtx()), ReadOptions(unit="mm", rate_hz=100.0))
    np.testing.assert_allclose(export.time_s, [0.0, 0.01, 0.02])
    assert export.taken["time"] == "from 0, 100 samples per second by --rate-hz; the header says 50.5"
    assert len(read_carto(written(tmp_path, rtx(without("Actual"))), ReadOptions(unit="mm", rate_hz=9.0)).line) == 3


def test_numbers_that_look_like_the_end_or_like_lines_are_numbers(tmp_path: Path) -> None:
    odd = struct.unpack("<d", b"EOF::\r\n\x40")[0], struct.unpack("<d", b"\nData:\r\n")[0], 1.0
    assert read_carto(written(tmp_path, rtx(values=odd)), IN_MM).values[:, 0].tolist() == list(odd)


@pytest.mark.parametrize("end", [b"EOF::", b"EOF::\n", b"\r\nEOF::\r\n", b"EOF::\r\n\r\n"])
def test_line_ends_around_the_end_do_not_matter(tmp_path: Path, end: bytes) -> None:
    assert read_carto(written(tmp_path, rtx(end=end)), IN_MM).values[:, 0].tolist() == list(LENGTHS)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (rtx(without("Data:")), "has no data"),
        (b"", "is no CARTO .rtx"),
        (b"time_s,length_mm\n0,1\n", "is no CARTO .rtx"),
        (rtx(without("Actual")), "the header has no `Actual sample rate`"),
        (rtx(changed("Actual sample rate", "0")), ":10 Actual sample rate: is no rate"),
        (rtx(changed("Actual sample rate", "1000,5")), "value: 1000,5"),
        (rtx(changed("Actual sample rate", "nan")), "is no rate"),
        (rtx(without("Sample no")), "the header has no `Sample no`"),
        (rtx(changed("Sample no", "three")), ":7 Sample no: is no number of samples"),
        (rtx(changed("Sample no", "0")), "is no number of samples"),
        (rtx(changed("Sample no", "4")), "value: 3 numbers\n    allowed: 4"),
        (rtx(changed("Sample no", "2")), "value: 3 numbers\n    allowed: 2"),
        (rtx(end=b""), "has no end"),
        (rtx()[: -len(b"EOF::\r\n") - 3], "is cut off\n    value: 2 numbers and 5 bytes behind `Data:`"),
        (rtx(values=(0.0, np.nan, np.inf)), ": sample 2, 3: is not finite\n    value: nan, inf"),
        (rtx((*HEADER[:-1], "Sample no: 4", "Data:")), "is there twice, with two values"),
    ],
)
def test_a_broken_file_is_refused_with_the_place_and_the_reason(tmp_path: Path, content: bytes, said: str) -> None:
    assert said in problems_of(tmp_path, content)


def test_the_unit_is_asked_for_and_never_guessed(tmp_path: Path) -> None:
    asked = problems_of(tmp_path, rtx(), ReadOptions())
    assert "does not say in which unit its lengths are" in asked
    assert "--unit" in asked
    assert "is no unit of a length\n    value: degC" in problems_of(tmp_path, rtx(), ReadOptions(unit="degC"))


def test_all_problems_come_at_once(tmp_path: Path) -> None:
    options = ReadOptions(columns=("time", "x"), sheet="One")
    text = problems_of(tmp_path, rtx(changed("Actual sample rate", "-1"), (0.0, np.nan, 1.0)), options)
    for part in ("--columns", "--sheet", "in which unit", "is no rate", "sample 2"):
        assert part in text


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot be read: No such file"):
        read_carto(tmp_path / "none.rtx", IN_MM)
