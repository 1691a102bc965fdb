"""Recordings of several reflectors at different places on the platform: what is read, and what is refused in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import compd
from compd.errors import RecordingError
from compd.recording.merge import merge_recordings
from compd.recording.reader import read_recording
from tests.support.recordings import csv_text, write_recording_files

TIP = "machine: tripod-cmm\nreference: {quantity: tool_position, frame: machine}\n"
SIDECAR = TIP.replace("}", ", reflectors: {2: [1, 2, -3], 7: [-4, 5.5, 0]}}")
NAMED = SIDECAR.replace("2:", "left:").replace("7:", "right:")


def with_reflectors(*names: str) -> str:
    """The usual rows with these reflectors, over and over."""
    header, *rows = csv_text().splitlines()
    return "\n".join([f"{header},reflector", *(f"{row},{names[k % len(names)]}" for k, row in enumerate(rows))]) + "\n"


@pytest.mark.parametrize(("sidecar", "names"), [(SIDECAR, ("2", "7")), (NAMED, ("left", "right"))])
def test_each_row_has_the_place_of_its_reflector(tmp_path: Path, sidecar: str, names: tuple[str, ...]) -> None:
    recording = read_recording(write_recording_files(tmp_path, with_reflectors(*names), sidecar))
    assert recording.target_P_mm is not None
    assert recording.target_P_mm[:3].tolist() == [[1, 2, -3], [-4, 5.5, 0], [1, 2, -3]]
    assert recording.select(np.array([1])).target_P_mm is not None
    assert "reflector" in recording.reference_columns
    assert "reflector" not in recording.quantities


def test_a_row_without_a_reflector_does_not_count(tmp_path: Path) -> None:
    recording = read_recording(write_recording_files(tmp_path, with_reflectors("2", "7", ""), SIDECAR))
    usable = recording.usable(recording.reference_columns)
    assert usable.mask.tolist() == ([True, True, False] * 7)[:20]


MISTAKES: dict[str, tuple[str, str, list[str]]] = {
    "no column": (csv_text(), SIDECAR, ["missing: reflector"]),
    "no places": (with_reflectors("2"), TIP, ["reflector: not a column of the quantity"]),
    "another name": (with_reflectors("2", "9"), SIDECAR, ["reflector", "no place", "9", "2, 7"]),
    "two numbers": (with_reflectors("2"), SIDECAR.replace("1, 2, -3", "1, 2"), ["reflectors", "axes of {P}"]),
    "no list": (with_reflectors("2"), SIDECAR.replace("[1, 2, -3]", "5"), ["reflectors", "axes of {P}"]),
    "another quantity": (
        with_reflectors("2"),
        SIDECAR.replace("tool_position", "link_length"),
        ["belongs to tool_position, not to link_length"],
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_refused_in_words(tmp_path: Path, mistake: str) -> None:
    text, sidecar, wanted = MISTAKES[mistake]
    with pytest.raises(RecordingError) as caught:
        read_recording(write_recording_files(tmp_path, text, sidecar))
    message = "\n".join(str(problem) for problem in caught.value.problems)
    assert [words for words in wanted if words not in message] == []


def test_recordings_of_reflectors_are_not_merged(tmp_path: Path) -> None:
    recording = read_recording(write_recording_files(tmp_path, with_reflectors("left", "right"), NAMED))
    with pytest.raises(RecordingError, match="reflectors"):
        merge_recordings([recording, recording], tmp_path / "both.csv")


def test_a_model_of_ones_own_has_no_platform(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    names = [f"{kind}_{axis}_mm" for kind in ("reference", "model") for axis in "xyz"]
    rows = [",".join([*map(repr, rng.uniform(0, 9, 6).tolist()), "2"]) for _ in range(12)]
    text = "\n".join([",".join([*names, "reflector"]), *rows]) + "\n"
    path = write_recording_files(tmp_path, text, SIDECAR.replace("tripod-cmm", "external"))
    with pytest.raises(RecordingError, match="the platform carries the tool"):
        compd.open_recording(path)
