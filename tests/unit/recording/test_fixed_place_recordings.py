"""Recordings of distances from fixed balls and of the tip in fixed pins: what is read, and what is refused in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.errors import RecordingError
from compd.recording.merge import merge_recordings
from compd.recording.reader import read_recording
from tests.support.recordings import csv_text, drop_columns, rename_column, write_recording_files

BALLBAR = "machine: tripod-cmm\nreference: {quantity: distance, sigma_um: 0.3}\n"
BALL = "machine: tripod-cmm\nreference: {quantity: distance, radius_mm: 14.5, absolute: true}\n"
PINS = "machine: tripod-cmm\nreference: {quantity: fixed_point}\n"
EXTERNAL_BAR = "machine: external\nreference: {quantity: distance}\n"


def without_tip(*, keep: str = "", name: str = "") -> str:
    """20 rows without the tip's columns; one of them kept under another name."""
    text = rename_column(keep, name)(csv_text()) if keep else csv_text()
    return drop_columns(*(f"reference_{axis}_mm" for axis in "xyz"))(text)


def ballbar_text() -> str:
    return without_tip(keep="reference_x_mm", name="reference_distance_mm")


def with_ids(text: str, column: str, *ids: str) -> str:
    """The text with one more column whose cells are these, over and over."""
    header, *rows = text.splitlines()
    rows = [f"{row},{ids[k % len(ids)]}" for k, row in enumerate(rows)]
    return "\n".join([f"{header},{column}", *rows]) + "\n"


def problems_of(path: Path) -> str:
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    return "\n".join(str(problem) for problem in caught.value.problems)


def test_a_ballbar_without_a_column_ball_has_one_fixed_end(tmp_path: Path) -> None:
    recording = read_recording(write_recording_files(tmp_path, ballbar_text(), BALLBAR))
    assert recording.reference is not None
    assert recording.reference.of_fixed_places
    assert recording.reference_distance_mm is not None
    assert recording.reference_distance_mm == pytest.approx(recording.columns["reference_distance_mm"])
    assert recording.fixed_end is not None
    assert set(recording.fixed_end.tolist()) == {0}
    assert recording.reference_sigma_mm * 1e3 == pytest.approx([0.3])
    assert recording.reference_columns == ("reference_distance_mm",)


def test_fixed_ends_have_numbers_or_names(tmp_path: Path) -> None:
    numbered = read_recording(write_recording_files(tmp_path, with_ids(ballbar_text(), "ball", "3", "7"), BALLBAR))
    assert numbered.fixed_end is not None
    assert numbered.fixed_end.tolist() == [3, 7] * 10
    assert numbered.end_name(7) == "ball 7"
    text = with_ids(ballbar_text(), "ball", "post", "table", "")
    named = read_recording(write_recording_files(tmp_path, text, BALLBAR))
    assert named.fixed_end is not None
    assert named.fixed_end[:3].tolist() == [0, 1, -1]
    assert [named.end_name(number) for number in (0, 1)] == ["ball post", "ball table"]


def test_a_known_radius_stands_in_place_of_the_column(tmp_path: Path) -> None:
    recording = read_recording(write_recording_files(tmp_path, with_ids(without_tip(), "ball", "1"), BALL))
    assert recording.reference_distance_mm is not None
    assert recording.reference_distance_mm == pytest.approx(np.full(20, 14.5))
    assert recording.reference is not None
    assert recording.reference.absolute


def test_pins_have_numbers_or_names(tmp_path: Path) -> None:
    recording = read_recording(write_recording_files(tmp_path, with_ids(without_tip(), "pin", "left", "right"), PINS))
    assert recording.fixed_end is not None
    assert recording.fixed_end.tolist() == [0, 1] * 10
    assert recording.end_name(1) == "pin right"
    assert recording.reference_axes == ("x", "y", "z")


def test_an_external_model_predicts_the_tip_beside_a_distance(tmp_path: Path) -> None:
    lines = ["time_s,model_x_mm,model_y_mm,model_z_mm,reference_distance_mm"]
    lines += [f"{k},{10 * k},{k},0,{100 + k}" for k in range(8)]
    recording = read_recording(write_recording_files(tmp_path, "\n".join(lines) + "\n", EXTERNAL_BAR))
    assert recording.model_mm is not None
    assert recording.model_mm.shape == (8, 3)


MISTAKES = {
    "no distance": (without_tip(), BALLBAR, ["missing: reference_distance_mm"]),
    "radius and column": (ballbar_text(), BALL, ["reference_distance_mm: the sidecar gives the distance", "one of"]),
    "change of length": (
        ballbar_text().replace(ballbar_text().splitlines()[1].split(",")[-1], "-0.012", 1),
        BALLBAR,
        ["reference_distance_mm", "row 2: no distance", "and not its change"],
    ),
    "no pin": (without_tip(), PINS, ["missing: pin"]),
    "the tip beside pins": (with_ids(csv_text(), "pin", "1"), PINS, ["reference_x_mm", "fixed_point", "pin"]),
    "a frame": (
        ballbar_text(),
        BALLBAR.replace("sigma_um: 0.3", "frame: machine"),
        ["frame", "fitted along", "delete it"],
    ),
    "radius of a pin": (
        with_ids(without_tip(), "pin", "1"),
        PINS.replace("}", ", radius_mm: 3}"),
        ["radius_mm", "belongs to distance, not to fixed_point"],
    ),
    "a radius of nothing": (without_tip(), BALL.replace("14.5", "0"), ["radius_mm", "greater than 0, in mm"]),
    "absolute maybe": (ballbar_text(), BALLBAR.replace("sigma_um: 0.3", "absolute: perhaps"), ["true, false"]),
    "attitude's noise": (ballbar_text(), BALLBAR.replace("sigma_um", "sigma_urad"), ["belongs to tool_pose"]),
    "a unit": (ballbar_text(), BALLBAR.replace("sigma_um: 0.3", "unit: arcsec"), ["unit", "of distance is um"]),
    "two sigmas": (ballbar_text(), BALLBAR.replace("0.3", "[0.3, 0.4]"), ["2 values for 1 reference columns"]),
    "names of a plate's balls": (
        with_ids(without_tip(), "ball", "a"),
        "machine: tripod-cmm\nreference: {quantity: ball_plate, balls: plate.csv}\n",
        ["column ball", "text"],
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_refused_in_words(tmp_path: Path, mistake: str) -> None:
    text, sidecar, wanted = MISTAKES[mistake]
    message = problems_of(write_recording_files(tmp_path, text, sidecar))
    assert [words for words in wanted if words not in message] == []


@pytest.mark.parametrize(("sidecar", "column", "of"), [(BALLBAR, "ball", "fixed balls"), (PINS, "pin", "pins")])
def test_recordings_with_fixed_places_are_not_merged(tmp_path: Path, sidecar: str, column: str, of: str) -> None:
    text = ballbar_text() if column == "ball" else without_tip()
    recording = read_recording(write_recording_files(tmp_path, with_ids(text, column, "1"), sidecar))
    with pytest.raises(RecordingError, match=f"the places of the {of} are fitted anew"):
        merge_recordings([recording, recording], tmp_path / "both.csv")
