"""Where an instrument's target is on the platform: found with its frame, fitted along, and held."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import compd
from compd.comparison import open_recording
from compd.comparison.recording_comparison import compare
from compd.errors import CompdError, RecordingError
from compd.recording import write_recording
from tests.support.measured import SIGMA_UM
from tests.support.pose_recordings import hexapod, poses

PLACE_P_MM = np.array([120.0, -45.0, 260.0])


def elsewhere(directory: Path, form: str = "rotation vector", with_time: bool = True) -> Path:
    """Poses of a target far from the tip, in an instrument's frame."""
    plain = open_recording(poses(directory, moved=True), hexapod())
    recording = plain.recording
    assert recording.reference_mm is not None
    assert recording.reference_rotation_rad is not None
    attitude = Rotation.from_rotvec(recording.reference_rotation_rad)
    turn = Rotation.from_matrix(plain.target_turn)
    points = recording.reference_mm + (attitude * turn.inv()).apply(PLACE_P_MM)
    columns = {name: values for name, values in recording.columns.items() if not name.startswith("reference_")}
    columns |= {f"reference_{axis}_mm": points[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"reference_r{axis}_rad": recording.reference_rotation_rad[:, k] for k, axis in enumerate("xyz")}
    path = directory / "elsewhere.csv"
    described = yaml.safe_load(recording.path.with_suffix(".yaml").read_text())
    write_recording(path, columns, {"machine": "hexapod", "reference": described["reference"]})
    if form == "quaternion" or not with_time:
        lines = path.read_text().splitlines()
        header = lines[0].split(",")
        table = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
        names = [name for name in header if with_time or name not in ("time_s",)]
        keep = [header.index(name) for name in names]
        table = table[:, keep]
        if form == "quaternion":
            at = [names.index(f"reference_r{axis}_rad") for axis in "xyz"]
            signs = np.where(np.arange(len(table)) % 2, 1.0, -1.0)[:, None]
            quaternion = signs * Rotation.from_rotvec(table[:, at]).as_quat()
            table = np.concatenate([np.delete(table, at, axis=1), quaternion], axis=1)
            names = [name for name in names if not name.endswith("_rad")] + [f"reference_q{part}" for part in "xyzw"]
        rows = [",".join(names), *(",".join(map(repr, row)) for row in table.tolist())]
        path.write_text("\n".join(rows) + "\n")
    return path


def test_frame_and_place_are_found_together(tmp_path: Path) -> None:
    aligned = open_recording(elsewhere(tmp_path), hexapod())
    assert aligned.target is not None
    np.testing.assert_allclose(aligned.target.place_P_mm, PLACE_P_MM, atol=0.02)
    comparison = compare(aligned)
    assert comparison.rms_um == pytest.approx(SIGMA_UM, rel=0.15)
    assert comparison.at_floor


@pytest.mark.parametrize(
    ("hold", "columns"), [((), 12), (("target.place",), 9), (("target.x", "target.c"), 10), (("frame",), 6)]
)
def test_what_is_held_is_not_fitted_along(tmp_path: Path, hold: tuple[str, ...], columns: int) -> None:
    aligned = open_recording(elsewhere(tmp_path), hexapod(), hold=hold)
    assert aligned.registration_columns.shape[2] == columns
    if "target.place" in hold:
        assert aligned.target is not None
        assert not aligned.target.place_P_mm.any()
        assert compare(aligned).rms_um > 1e3  # the place is 290 mm off


def test_a_platform_that_does_not_turn_shows_no_place(tmp_path: Path) -> None:
    from compd.comparison.alignment.target_place import shown_directions

    tips = np.random.default_rng(1).uniform(-100, 100, (40, 3))
    level = np.tile(np.eye(3), (40, 1, 1))
    assert shown_directions(tips, level, np.ones(40, dtype=bool)).shape == (3, 0)
    # turns about one axis alone show no place along it
    about_z = Rotation.from_rotvec(np.random.default_rng(2).uniform(-0.3, 0.3, (40, 1)) * [0.0, 0.0, 1.0]).as_matrix()
    shown = shown_directions(tips, about_z, np.ones(40, dtype=bool))
    assert shown.shape == (3, 2)
    np.testing.assert_allclose(shown[2], 0.0, atol=1e-9)


def test_what_cannot_be_held_is_told(tmp_path: Path) -> None:
    with pytest.raises(CompdError, match="no part of a registration") as caught:
        open_recording(elsewhere(tmp_path), hexapod(), hold=["targets", "frame.q"])
    assert "targets, frame.q" in str(caught.value)


def test_quaternions_and_rotation_vectors_are_one_attitude(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    one = open_recording(elsewhere(tmp_path / "a"), hexapod())
    other = open_recording(elsewhere(tmp_path / "b", "quaternion"), hexapod())
    np.testing.assert_allclose(one.measured_mm, other.measured_mm, atol=1e-6)


def test_a_quaternion_that_is_none_is_told_with_its_row(tmp_path: Path) -> None:
    path = elsewhere(tmp_path, "quaternion")
    lines = path.read_text().splitlines()
    cells = lines[7].split(",")
    cells[-1] = "3.0"
    lines[7] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(RecordingError, match=r"row 8.*no quaternion of a rotation"):
        open_recording(path, hexapod())


def test_poses_at_rest_need_no_time(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    timed = open_recording(elsewhere(tmp_path / "a"), hexapod())
    aligned = open_recording(elsewhere(tmp_path / "b", with_time=False), hexapod())
    assert not aligned.recording.has_time
    np.testing.assert_allclose(aligned.measured_mm, timed.measured_mm, atol=1e-6)
    # what depends on when, or in which order, rows were taken is not there
    assert {"time", "order", "motion"}.isdisjoint(aligned.rows.available)
    assert {"time", "order", "motion"} <= timed.rows.available


def test_a_sample_of_a_long_recording_holds_the_same(tmp_path: Path) -> None:
    path = elsewhere(tmp_path)
    held = compd.open_sample(path, hexapod(), hold=["target.place"], ranges=["link_zero.z=-1..1mm"])
    assert held.registration_columns.shape[2] == 9
    assert [str(stated) for stated in held.ranges] == ["link_zero.z=-1..1mm"]
    assert compd.compare(held).rms_um > 1e3
    with pytest.raises(CompdError, match="no part of a registration"):
        compd.open_sample(path, hexapod(), hold=["targets"])


def test_holding_what_the_recording_does_not_fit_is_refused(tmp_path: Path) -> None:
    path = elsewhere(tmp_path)
    sidecar = path.with_suffix(".yaml")
    in_machine = sidecar.read_text().replace("frame: instrument", "frame: machine")
    assert in_machine != sidecar.read_text()
    sidecar.write_text(in_machine)
    with pytest.raises(CompdError, match="holding them changes nothing") as caught:
        open_recording(path, hexapod(), hold=["frame.x", "target.place", "target.a"])
    assert "frame.x, target.x, target.y, target.z" in str(caught.value)
    assert "target.a, target.b, target.c" in str(caught.value), "what it fits"
