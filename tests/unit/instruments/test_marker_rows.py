"""Rows in which a number stands for what was not measured are left out, and those of measurements are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.arrays import FloatArray
from tests.unit.instruments.reading import read

RNG = np.random.default_rng(4)
TRACKER_MM = RNG.normal((2400.0, -950.0, 410.0), 60.0, (20, 3))
PLATE_MM = RNG.normal((0.0, 0.0, 190.0), 30.0, (20, 3))


def points(rows: list[str], places_mm: FloatArray = TRACKER_MM) -> str:
    measured = [",".join(f"{value:.6f}" for value in place) for place in places_mm]
    return "X [mm],Y [mm],Z [mm]\n" + "\n".join([*measured[:10], *rows, *measured[10:]]) + "\n"


@pytest.mark.parametrize(
    "marker",
    [
        "-9999,-9999,-9999",
        "99999.999,99999.999,99999.999",
        "2400.1,-950.3,-999.999",
        "9.99e+20,9.99e+20,9.99e+20",
        "0,0,0",
        "0.000000,0.000000,0.000000",
    ],
)
def test_a_single_marker_is_left_out(tmp_path: Path, marker: str) -> None:
    export = read(tmp_path, points([marker]))
    assert len(export.values) == 20
    (reason,) = export.left_out
    assert "marks what was not measured (line 12)" in reason


@pytest.mark.parametrize("marker", ["-1,-1,-1", "32767,32767,32767", "100000,0,0"])
def test_any_number_is_a_marker_that_comes_again_far_away(tmp_path: Path, marker: str) -> None:
    assert len(read(tmp_path, points([marker, marker])).values) == 20


def test_several_kinds_of_markers_are_left_out(tmp_path: Path) -> None:
    export = read(tmp_path, points(["-9999,-9999,-9999", "0,0,0", "99999,99999,99999"]))
    assert len(export.values) == 20


def test_a_lost_beam_is_left_out_of_a_frame_in_the_machine_too(tmp_path: Path) -> None:
    assert len(read(tmp_path, points(["0,0,0"] * 3, PLATE_MM)).values) == 20


@pytest.mark.parametrize("row", ["0,0,0", "9.99,9.99,9.99", "99.9,0,0"])
def test_what_lies_among_the_others_is_measured(tmp_path: Path, row: str) -> None:
    places_mm = np.random.default_rng(5).normal(0.0, 60.0, (20, 3))
    assert len(read(tmp_path, points([row, row], places_mm)).values) == 22


def test_repeats_at_one_place_and_a_single_far_point_are_measured(tmp_path: Path) -> None:
    assert len(read(tmp_path, points(["9000.1,-950.5,400.25"])).values) == 21
    same = f"{TRACKER_MM[3][0]:.6f},{TRACKER_MM[3][1]:.6f},{TRACKER_MM[3][2]:.6f}"
    assert len(read(tmp_path, points([same, same])).values) == 22


def test_a_length_of_nothing_is_a_length(tmp_path: Path) -> None:
    lengths = "".join(f"{k}.5,{100 + k}.25\n" for k in range(20))
    assert len(read(tmp_path, f"time_s,length_mm\n20.5,0\n21.5,0\n{lengths}").values) == 22
    assert len(read(tmp_path, f"time_s,length_mm\n20.5,-9999\n{lengths}").values) == 20


@pytest.mark.parametrize("word", ["9.9E37", "-9.9E+37", "9.91E37", "3.4028235e+38"])
def test_what_scpi_sends_for_no_number_is_no_measurement(tmp_path: Path, word: str) -> None:
    assert len(read(tmp_path, points([f"{word},{word},{word}", f"2400.1,-950.3,{word}"])).values) == 20
    lengths = "\n".join(f"{20 + i},{240 + i / 1000}" for i in range(20))
    assert len(read(tmp_path, f"time_s,length_mm\n{lengths}\n50,{word}\n").values) == 20
