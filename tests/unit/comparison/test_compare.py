"""The model beside recordings: the floor is reached, what is missing is named, every kind of reference works."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compd.comparison.alignment.align_recording import align_recording
from compd.comparison.recording_comparison import compare
from compd.configuration import load, shipped_configuration
from compd.errors import CompdError, RecordingError
from compd.recording import read_recording, write_recording
from tests.support.measured import SIGMA_UM, Floats, aligned, gauges, hidden, record, tips_mm, tripod
from tests.support.paths import SHARED

AT_FLOOR = 1.1


def shared(*parts: str) -> Path:
    path = SHARED.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"no recording: {path} is not there")
    return path


@pytest.mark.parametrize("name", ["train.csv", "valid.csv"])
def test_with_nothing_missing_the_residual_is_the_noise(name: str) -> None:
    comparison = compare(aligned(shared("recordings", "example-nothing-missing", name)))
    assert comparison.floor_ratio < AT_FLOOR
    assert comparison.at_floor
    assert comparison.floor.source == "repeats"
    assert comparison.floor.um == pytest.approx(SIGMA_UM, rel=0.08)
    assert not comparison.trends
    assert not comparison.outlier.any()


@pytest.mark.parametrize("case", ["link-expansion", "plate-bending", "not-in-the-library", "elastic-and-backlash"])
def test_a_missing_cause_is_seen(case: str) -> None:
    comparison = compare(aligned(shared("recordings", f"example-{case}", "train.csv")))
    assert comparison.floor_ratio > 5
    assert not comparison.at_floor
    assert comparison.trends


@pytest.mark.parametrize(
    ("case", "coordinate", "covariate"),
    [
        ("link-expansion", "link 2", "temperature_link_2"),
        ("plate-bending", "z", "temperature_plate_top - temperature_plate_bottom"),
        ("not-in-the-library", "z", "humidity"),
    ],
)
def test_words_name_what_the_error_follows(case: str, coordinate: str, covariate: str) -> None:
    comparison = compare(aligned(shared("recordings", f"example-{case}", "train.csv")))
    first = comparison.trends[0]
    assert (first.coordinate, first.covariate) == (coordinate, covariate)
    assert first.text.startswith(f"{coordinate} error follows {covariate}, ")
    assert first.explained > 0.9


def test_a_hexapod_reaches_the_floor(tmp_path: Path) -> None:
    configuration = load(shipped_configuration("hexapod.yaml"))
    columns = gauges(300, 5, links=6, joints=len(configuration.wiring.joint))
    columns |= {f"scale_{i}_mm": columns[f"scale_{i}_mm"] / 4 for i in range(1, 7)}
    path = record(tmp_path, columns, machine="hexapod", configuration=configuration)
    assert compare(aligned(path, configuration)).floor_ratio < AT_FLOOR


def test_a_real_machine_with_a_model_of_its_own() -> None:
    comparison = compare(align_recording(read_recording(shared("real", "voron-frame-expansion.csv")), None))
    assert comparison.aligned.labels == ("z",)
    assert comparison.floor.um == pytest.approx(1.2, abs=0.2)  # repeats scatter less than the declared motor step
    assert comparison.rms_um > 50
    assert any(trend.covariate == "temperature_frame" for trend in comparison.trends)
    assert comparison.as_json()["prediction_std_um"]["gauges"] is None


def test_an_instrument_in_a_frame_of_its_own(tmp_path: Path) -> None:
    columns = gauges(300, 2)
    path = record(tmp_path, columns)
    in_M = compare(aligned(path))
    turned = Rotation.from_rotvec([0.4, -1.1, 2.0]).as_matrix()
    moved = _move(path, turned, np.array([1500.0, -320.0, 80.0]), {"quantity": "tool_position", "frame": "instrument"})
    comparison = compare(aligned(moved))
    assert comparison.aligned.registration is not None
    np.testing.assert_allclose(comparison.aligned.registration.rotation, turned.T, atol=1e-6)
    assert comparison.rms_um == pytest.approx(in_M.rms_um, rel=0.01)
    assert "registration" in comparison.as_json()


def test_gross_rows_do_not_bend_the_instruments_frame(tmp_path: Path) -> None:
    columns = gauges(300, 2)
    path = record(tmp_path, columns)
    turned = Rotation.from_rotvec([0.0, 0.1, -0.3]).as_matrix()
    to = {"quantity": "tool_position", "frame": "instrument"}
    clean = compare(aligned(_move(path, turned, np.array([10.0, 20.0, 30.0]), to)))
    gross = compare(aligned(_move(path, turned, np.array([10.0, 20.0, 30.0]), to, gross_mm=3.0)))
    assert gross.outlier.sum() == 3
    assert gross.rms_um == pytest.approx(clean.rms_um, rel=0.02)


def _move(path: Path, turned: Floats, by_mm: Floats, reference: dict[str, object], gross_mm: float = 0.0) -> Path:
    """The same recording from an instrument elsewhere."""
    recording = read_recording(path, tripod())
    assert recording.reference_mm is not None
    instrument = (recording.reference_mm @ turned.T) + by_mm
    instrument[[20, 110, 200], 1] += gross_mm
    columns = {**recording.columns, **{f"reference_{axis}_mm": instrument[:, k] for k, axis in enumerate("xyz")}}
    moved = path.with_name("moved.csv")
    write_recording(moved, columns, {"machine": "tripod-cmm", "reference": reference}, overwrite=True)
    return moved


def test_one_axis_alone(tmp_path: Path) -> None:
    path = record(tmp_path, gauges(300, 6), axes="z")
    comparison = compare(aligned(path))
    assert comparison.aligned.labels == ("z",)
    assert comparison.floor_ratio < AT_FLOOR
    assert list(comparison.as_json()["residual_rms_xyz_um"]) == ["z"]


def test_links_measured_by_interferometer(tmp_path: Path) -> None:
    columns = gauges(200, 7)
    rng = np.random.default_rng(0)
    lengths = {
        f"reference_link_{i}_mm": columns[f"scale_{i}_mm"]
        - (columns[f"joint_{3 * i - 2}_um"] + (columns[f"joint_{3 * i - 1}_um"] + columns[f"joint_{3 * i}_um"]) / 2)
        / 1e3
        + rng.normal(0, 1e-4, 200)
        for i in (1, 3)
    }
    gone = {name: values for name, values in columns.items() if not name.startswith("frame_")}
    reference = {"quantity": "link_length", "sigma_um": 0.1}
    path = tmp_path / "links.csv"
    write_recording(path, {**gone, **lengths}, {"machine": "tripod-cmm", "reference": reference})
    comparison = compare(aligned(path))
    assert comparison.aligned.labels == ("link 1", "link 3")
    assert comparison.rms_um == pytest.approx(0.1, rel=0.1)
    assert comparison.floor_ratio < AT_FLOOR
    assert comparison.contributions["joints"].without_rms_um > 5


def test_a_ball_plate(tmp_path: Path) -> None:
    columns = gauges(90, 8)
    columns["visit"] = np.arange(90.0)
    truth = tips_mm(tmp_path, columns, (), tripod(), "tripod-cmm")
    turned = Rotation.from_rotvec([0.01, -0.02, 1.3]).as_matrix()
    on_plate = (truth - np.array([12.0, -7.0, 150.0])) @ turned
    on_plate += np.random.default_rng(4).normal(0, SIGMA_UM / 1e3, on_plate.shape)
    lines = ["ball,x_mm,y_mm,z_mm", *(",".join(map(repr, (k, *place.tolist()))) for k, place in enumerate(on_plate))]
    (tmp_path / "plate.csv").write_text("\n".join(lines) + "\n")
    path = tmp_path / "balls.csv"
    reference = {"quantity": "ball_plate", "balls": "plate.csv", "sigma_um": SIGMA_UM}
    write_recording(path, {**columns, "ball": np.arange(90.0)}, {"machine": "tripod-cmm", "reference": reference})
    comparison = compare(aligned(path))
    assert comparison.aligned.registered
    assert comparison.floor.source == "declared"
    assert comparison.rms_um == pytest.approx(SIGMA_UM, rel=0.12)


def test_attitude_is_compared_too(tmp_path: Path) -> None:
    columns = gauges(60, 9)
    path = record(tmp_path, columns)
    first = aligned(path)
    recording = first.recording
    turned = Rotation.from_matrix(first.rows.rotation_M_P) * Rotation.from_rotvec([0.0, 0.0, 20e-6])
    attitude = {f"reference_r{axis}_rad": turned.as_rotvec()[:, k] for k, axis in enumerate("xyz")}
    pose = tmp_path / "pose.csv"
    reference = {"quantity": "tool_pose", "frame": "machine", "sigma_um": SIGMA_UM}
    write_recording(pose, {**recording.columns, **attitude}, {"machine": "tripod-cmm", "reference": reference})
    report = compare(aligned(pose)).as_json()
    assert report["attitude_rms_urad"] == pytest.approx(20 / np.sqrt(3), rel=1e-3)
    assert report["floor_ratio"] < 1.3


@pytest.mark.parametrize("size_um", [3.0, 50.0, 5000.0])
def test_one_per_cent_of_gross_rows_moves_nothing(tmp_path: Path, size_um: float) -> None:
    columns = gauges(600, 11)
    path = record(tmp_path, columns)
    clean = compare(aligned(path))
    recording = read_recording(path, tripod())
    spoilt = dict(recording.columns)
    rows = np.arange(30, 600, 100)
    spoilt["reference_y_mm"] = spoilt["reference_y_mm"].copy()
    spoilt["reference_y_mm"][rows] += size_um / 1e3
    write_recording(path, spoilt, {"machine": "tripod-cmm", "reference": _plain()}, overwrite=True)
    comparison = compare(aligned(path))
    assert comparison.as_json()["outlier_rows"] == (rows + 2).tolist()
    assert comparison.rms_um == pytest.approx(clean.rms_um, rel=0.01)
    assert comparison.floor.um == pytest.approx(clean.floor.um, rel=0.03)
    assert comparison.as_json()["excluded_by_reason"] == {"beyond all noise": 6}


def _plain() -> dict[str, object]:
    return {"quantity": "tool_position", "frame": "machine", "sigma_um": SIGMA_UM}


def test_a_rare_load_that_bends_the_machine_is_not_gross(tmp_path: Path) -> None:
    columns = gauges(600, 12)
    loaded = np.repeat(np.arange(200) % 4 == 0, 3)
    columns |= {f"force_{axis}_N": np.where(loaded, columns[f"force_{axis}_N"], 0.0) for axis in "xyz"}
    comparison = compare(aligned(record(tmp_path, columns, [hidden("link_elasticity", 20.0)])))
    assert comparison.outlier.sum() <= 0.03 * 600
    assert not comparison.at_floor


def test_empty_cells_leave_their_row_out_and_are_counted(tmp_path: Path) -> None:
    path = record(tmp_path, gauges(60, 13))
    lines = path.read_text().splitlines()
    index = lines[0].split(",").index("scale_2_mm")
    for row in (10, 11, 12):
        cells = lines[row].split(",")
        cells[index] = ""
        lines[row] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    report = compare(aligned(path)).as_json()
    assert report["rows_used"] == 57
    assert report["rows_excluded"] == 3
    assert report["excluded_by_reason"] == {"scale_2_mm is empty": 3}


def test_switching_the_joints_off_is_what_unmoved_joints_predict(tmp_path: Path) -> None:
    columns = gauges(60, 14)
    path = record(tmp_path, columns)
    with_joints = aligned(path)
    unmoved = {name: np.zeros(60) if name.startswith("joint_") else values for name, values in columns.items()}
    for axis in "xyz":
        unmoved[f"reference_{axis}_mm"] = with_joints.recording.columns[f"reference_{axis}_mm"]
    write_recording(tmp_path / "still.csv", unmoved, {"machine": "tripod-cmm", "reference": _plain()})
    still = compare(aligned(tmp_path / "still.csv"))
    assert compare(with_joints).contributions["joints"].without_rms_um == pytest.approx(still.rms_um, rel=1e-3)


def test_an_effect_that_lacks_its_quantity_is_refused_in_words(tmp_path: Path) -> None:
    columns = {name: values for name, values in gauges(30, 15).items() if "temperature_link" not in name}
    with pytest.raises(CompdError, match="needs temperature_link_2_degC"):
        compare(aligned(record(tmp_path, columns)), [hidden("link_expansion", 1.0)])


def test_rows_without_a_pose_are_counted_with_the_reason(tmp_path: Path) -> None:
    path = record(tmp_path, gauges(30, 16))
    text = path.read_text().splitlines()
    index = text[0].split(",").index("scale_1_mm")
    cells = text[5].split(",")
    cells[index] = "-900"
    text[5] = ",".join(cells)
    path.write_text("\n".join(text) + "\n")
    with_configuration = read_recording(path)
    comparison = compare(align_recording(with_configuration, tripod()))
    (reason,) = comparison.left_out
    assert reason.startswith("no pose: ")
    assert comparison.used.sum() == 29


def test_too_few_rows_are_refused(tmp_path: Path) -> None:
    path = record(tmp_path, gauges(4, 17))
    with pytest.raises(RecordingError, match="too few rows"):
        compare(aligned(path))
