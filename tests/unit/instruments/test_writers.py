"""Samples in every shape, read back by a few lines of their own, and by the readers where these are here."""

from __future__ import annotations

import struct
import zipfile
from datetime import datetime
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from compd.errors import CompdError
from compd.instruments.export import ReadOptions
from compd.instruments.formats import written_forms
from compd.instruments.formats.carto.reader import read_carto
from compd.instruments.formats.spatial_analyzer.writer import write_spatial_analyzer
from compd.instruments.formats.workbook.reader import read_workbook
from compd.instruments.samples import LENGTH, POSE, POSITION, Samples

START = datetime(2026, 2, 10, 12, 58, 22, 250000)
VALUES = np.array([[1.5, -2.25, 1200.000125], [0.0, 0.000001, -3.0], [10.0, 20.0, 30.0]])
TIMES = np.array([0.0, 0.5, 1.0])
TRACK = Samples(POSITION, VALUES, TIMES, start=START)
POINTS = Samples(POSITION, VALUES, names=("P1", "P2", "P3"))
LINK = Samples(LENGTH, VALUES[:, :1], TIMES, start=START)


def text_of(shape: str, samples: Samples) -> str:
    return written_forms()[shape].write(samples).decode()


def test_spatial_analyzer_of_a_track() -> None:
    assert text_of("sa", TRACK).split("\r\n") == [
        "// SpatialAnalyzer SA ( written by compd )",
        "// Points Relative to Coordinate Frame 'A::WORLD'",
        "// AXES = CARTESIAN: X,  Y,  Z (mm)",
        "A,  Points,  0,  1.500000,  -2.250000,  1200.000125,  02/10/26 12:58:22",
        "A,  Points,  1,  0.000000,  0.000001,  -3.000000,  02/10/26 12:58:22",
        "A,  Points,  2,  10.000000,  20.000000,  30.000000,  02/10/26 12:58:23",
        "",
    ]


def test_spatial_analyzer_of_points_in_inches() -> None:
    inches = Samples(POSITION, VALUES[2:], names=("P7",), unit="inch", group="day 1")
    text = write_spatial_analyzer(inches, frame="B::Table", collection="B").decode()
    assert "Frame 'B::Table'" in text
    assert "(inches)" in text
    assert text.split("\r\n")[3] == "B,  day 1,  P7,  0.393701,  0.787402,  1.181102"


def test_commas_with_seconds_and_with_iso_stamps() -> None:
    assert text_of("csv", TRACK).splitlines()[:2] == [
        "time_s,x_mm,y_mm,z_mm",
        "0.000000,1.500000,-2.250000,1200.000125",
    ]
    assert text_of("csv", POINTS).splitlines()[1] == "P1,1.500000,-2.250000,1200.000125"
    assert text_of("iso", TRACK).splitlines()[::2] == [
        "time,x_mm,y_mm,z_mm",
        "2026-02-10T12:58:22.750,0.000000,0.000001,-3.000000",
    ]
    assert text_of("csv", LINK).splitlines()[:2] == ["time_s,length_mm", "0.000000,1.500000"]


def test_metres_keep_a_nanometre_and_attitude_is_in_rad() -> None:
    poses = Samples(POSE, np.hstack([VALUES, [[0.001, 0.0, -0.5]] * 3]), TIMES, unit="m")
    assert text_of("csv", poses).splitlines()[:2] == [
        "time_s,x_m,y_m,z_m,rx_rad,ry_rad,rz_rad",
        "0.000000,0.001500000,-0.002250000,1.200000125,0.001000000,0.000000000,-0.500000000",
    ]


def test_german_text_has_semicolons_commas_and_a_mark() -> None:
    raw = written_forms()["german"].write(TRACK)
    assert raw.startswith(b"\xef\xbb\xbfZeit;")
    assert raw.decode("utf-8-sig").split("\r\n")[:2] == [
        "Zeit;x [mm];y [mm];z [mm]",
        "10.02.2026 12:58:22,250;1,500000;-2,250000;1200,000125",
    ]
    assert "name;x [mm]" in text_of("german", POINTS)


def test_blanks_have_numbers_alone() -> None:
    rows = [line.split() for line in text_of("blanks", TRACK).splitlines()]
    np.testing.assert_allclose(np.array(rows, dtype=float), VALUES, atol=1e-9)
    assert text_of("blanks", POINTS).split()[:2] == ["P1", "1.500000"]


def test_carto_byte_by_byte() -> None:
    raw = written_forms()["carto"].write(LINK)
    text, _, data = raw.partition(b"Data:\r\n")
    keys = dict(line.split(": ", 1) for line in text.decode("ascii").split("\r\n") if ": " in line)
    assert text.startswith(b"HEADER::\r\n")
    assert (keys["Sample no"], keys["Actual sample rate"], keys["Date"]) == ("3", "2", "10/02/2026 12:58:22")
    assert struct.unpack("<3d", data[:24]) == (1.5, 0.0, 10.0)
    assert data[24:] == b"EOF::\r\n"


def test_a_workbook_cell_by_cell(tmp_path: Path) -> None:
    path = tmp_path / "list.xlsx"
    path.write_bytes(written_forms()["xlsx"].write(POINTS))
    with zipfile.ZipFile(path) as archive:
        sheet = ElementTree.fromstring(archive.read("xl/worksheets/sheet1.xml"))
    space = {"x": "http://schemas.openxmlformats.org/spreadsheetml/2006/main"}
    numbers = {
        cell.get("r"): float(cell.findtext("x:v", "nan", space))
        for cell in sheet.iterfind(".//x:c", space)
        if cell.get("t", "n") == "n" and cell.find("x:v", space) is not None
    }
    assert (numbers["B4"], numbers["D4"], numbers["C5"]) == (1.5, 1200.000125, 0.000001)


@pytest.mark.parametrize("samples", [TRACK, POINTS, LINK])
def test_a_workbook_comes_back_by_its_reader(tmp_path: Path, samples: Samples) -> None:
    path = tmp_path / "list.xlsx"
    path.write_bytes(written_forms()["xlsx"].write(samples))
    table = read_workbook(path, ReadOptions())
    assert table.header == tuple(samples.header("time_s" if samples.time_s is not None else ""))
    assert table.header_line == 3
    np.testing.assert_array_equal(np.array(table.columns[-len(samples.axes) :], dtype=float).T, samples.values)


@pytest.mark.parametrize("unit", ["mm", "um", "inch"])
def test_carto_comes_back_by_its_reader(tmp_path: Path, unit: str) -> None:
    path = tmp_path / "link.rtx"
    path.write_bytes(written_forms()["carto"].write(Samples(LENGTH, VALUES[:, :1], TIMES, unit=unit)))
    export = read_carto(path, ReadOptions(unit=unit))
    np.testing.assert_allclose(export.values, VALUES[:, :1], rtol=1e-14)
    np.testing.assert_allclose(export.time_s, TIMES)


@pytest.mark.parametrize(
    ("shape", "samples", "said"),
    [
        ("sa", LINK, "SpatialAnalyzer ASCII: has no place for these"),
        ("carto", TRACK, "CARTO .rtx: has no place for these"),
        ("carto", Samples(LENGTH, VALUES[:, :1], names=("a", "b", "c")), "points without a time"),
        ("iso", Samples(POSITION, VALUES, TIMES), "stamps its rows with a date"),
        ("csv", Samples(("x", "y"), VALUES[:, :2]), "allowed: length or x, y, z or x, y, z, rx, ry, rz"),
        ("csv", Samples(POSITION, VALUES, unit="furlong"), "is no unit of a length"),
    ],
)
def test_what_a_shape_cannot_hold_is_refused(shape: str, samples: Samples, said: str) -> None:
    with pytest.raises(CompdError) as caught:
        written_forms()[shape].write(samples)
    assert said in str(caught.value)
