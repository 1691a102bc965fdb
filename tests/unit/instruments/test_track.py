"""Exports with times as tracks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compd.errors import RecordingError
from compd.instruments.track import track_of
from tests.unit.instruments.reading import read, refused


def test_positions_between_samples_and_attitude_on_the_shortest_arc(tmp_path: Path) -> None:
    """Half a turn is one attitude with two rotation vectors: from one to the other nothing turns."""
    text = "time_s,x_mm,y_mm,z_mm,rx_rad,ry_rad,rz_rad\n0,0,0,0,3.13,0,0\n1,2,4,6,-3.13,0,0\n2,4,8,12,-3.13,0,0\n"
    track = track_of(read(tmp_path, text))
    assert track.axes == ("x", "y", "z")
    np.testing.assert_allclose(track.position_at(np.array([0.5, 9.0])), [[1, 2, 3], [4, 8, 12]])
    middle = Rotation.from_rotvec(track.rotation_at(np.array([0.5, 1.5])))
    wanted = Rotation.from_rotvec([[np.pi, 0, 0], [-3.13, 0, 0]])
    np.testing.assert_allclose((middle * wanted.inv()).magnitude(), 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("name,x_mm,y_mm\nA,1,2\nB,2,3\nC,2,3\n", "no column is a time"),
        ("time_s,x_mm\n1.5,1\n2.5,2\n", "2 rows have a time and x"),
        ("time_s,x_mm\n1.5,1\n2.5,2\n2.0,2\n3.5,2\n", r"export.txt:4: time does not rise \(line 4\)"),
    ],
)
def test_what_is_no_track_is_refused(tmp_path: Path, text: str, wanted: str) -> None:
    with pytest.raises(RecordingError, match=wanted):
        track_of(read(tmp_path, text))


def stamped(times: list[str]) -> str:
    return "time,x_mm\n" + "".join(f"{time},{k}\n" for k, time in enumerate(times))


AUTUMN = ["2024-10-27 02:59:58.5", "2024-10-27 02:59:59.5", "2024-10-27 02:00:00.5", "2024-10-27 02:00:01.5"]


def test_a_clock_that_was_set_back_is_told_and_mended(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="the clock was set back by an hour") as caught:
        track_of(read(tmp_path, stamped(AUTUMN)))
    assert "export.txt:4" in str(caught.value)
    assert "--clock-set-back" in str(caught.value)
    export = read(tmp_path, stamped(AUTUMN), clock_set_back=True)
    np.testing.assert_allclose(np.diff(track_of(export).time_s), 1.0)
    assert "1 h added from line 4 on" in export.taken["time"]


@pytest.mark.parametrize(
    "times",
    [
        [AUTUMN[0], AUTUMN[2], AUTUMN[1], AUTUMN[3]],  # falls twice, when sorted badly
        ["2024-10-27 02:30:00.5", "2024-10-27 02:00:00.5", "2024-10-27 02:00:01.5"],  # by half an hour
        AUTUMN[2:],
    ],
)
def test_an_hour_is_added_nowhere_else(tmp_path: Path, times: list[str]) -> None:
    assert "its clock was not set back by an hour" in refused(tmp_path, stamped(times), clock_set_back=True)


def test_two_hours_sorted_into_one_are_no_track(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    time_s = np.sort(rng.uniform(0.0, 20.0, 400))
    places_mm = np.where(rng.random(400)[:, None] < 0.5, 100.0, -80.0) + rng.normal(0.0, 1e-3, (400, 3))
    text = "time_s,x_mm,y_mm,z_mm\n" + "".join(
        f"{t:.4f},{x:.5f},{y:.5f},{z:.5f}\n" for t, (x, y, z) in zip(time_s, places_mm, strict=True)
    )
    with pytest.raises(RecordingError, match="of two tracks in turn"):
        track_of(read(tmp_path, text))


def test_a_track_with_single_wild_samples_is_one(tmp_path: Path) -> None:
    time_s = np.arange(600) / 20
    x_mm = 50 * np.sin(time_s) + np.where(np.arange(600) % 29 == 3, 5.0, 0.0)
    text = "time_s,x_mm\n" + "".join(f"{t:.4f},{x:.5f}\n" for t, x in zip(time_s, x_mm, strict=True))
    assert len(track_of(read(tmp_path, text)).time_s) == 600
