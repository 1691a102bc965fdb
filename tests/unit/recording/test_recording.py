"""Reading what is right: every variant of the format, the examples, and what was written."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from compd.cli.measurements.recording.recording import recording as recording_command
from compd.columns import is_covariate
from compd.configuration import load
from compd.errors import RecordingError
from compd.recording.reader import read_recording
from compd.recording.sidecar import sidecar_contents
from compd.recording.writer import write_recording
from compd.travel_direction import row_directions
from tests.support.paths import ROOT, SHARED
from tests.support.recordings import (
    HEADER,
    SIDECAR,
    Edit,
    csv_text,
    drop_columns,
    rename_column,
    set_cell,
    set_column,
    write_recording_files,
)

TRIPOD = ROOT / "config" / "tripod-cmm.yaml"
EXAMPLES = ("elastic-and-backlash", "link-expansion", "not-in-the-library", "nothing-missing", "plate-bending")
NO_REFERENCE = drop_columns("reference_x_mm", "reference_y_mm", "reference_z_mm")


@pytest.mark.parametrize("name", ["joint_1_deg", "joint_6_rad", "scale_2_arcsec"])
def test_the_angle_of_a_joint_is_no_misspelt_length(name: str) -> None:
    """A robot's joints are recorded in degrees: no comparator shows these."""
    assert is_covariate(name)
    assert not is_covariate(name.rsplit("_", 1)[0] + "_mm")


@pytest.mark.parametrize("part", ["train", "valid"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_example_reads_without_complaint(name: str, part: str) -> None:
    path = SHARED / "recordings" / f"example-{name}" / f"{part}.csv"
    if not path.is_file():
        pytest.skip(f"needs the example recordings in {SHARED}")
    recording = read_recording(path, load(TRIPOD))
    assert recording.warnings == ()
    assert recording.left_out == {}
    assert recording.scale_mm is not None
    assert recording.joint_mm is not None
    assert recording.frame_mm is not None
    shapes = (
        recording.scale_mm.shape[1],
        recording.joint_mm.shape[1],
        recording.frame_mm.shape[1],
        recording.reference_axes,
    )
    assert shapes == (3, 9, 9, ("x", "y", "z"))
    assert recording.usable([*recording.gauge_columns, *recording.reference_columns]).mask.all()
    assert "temperature_link_2_degC" in recording.quantities
    assert recording.reference_sigma_mm == pytest.approx([0.00015] * 3)
    assert "joint_1_um" not in recording.quantities


@pytest.mark.parametrize("name", EXAMPLES)
def test_direction_from_the_scales_is_the_recorded_one(name: str) -> None:
    """Most rows: an axis may have gone out and back between two rows, which only the column knows."""
    path = SHARED / "recordings" / f"example-{name}" / "train.csv"
    if not path.is_file():
        pytest.skip(f"needs the example recordings in {SHARED}")
    recording = read_recording(path)
    assert recording.scale_mm is not None
    assert recording.approach is not None
    derived = row_directions(recording.scale_mm, recording.session)
    known = np.isfinite(derived)
    assert known.mean() > 0.95
    assert (derived[known] == recording.approach[known]).mean() > 0.95


def test_real_recording_reads_without_complaint() -> None:
    path = SHARED / "real" / "voron-frame-expansion.csv"
    if not path.is_file():
        pytest.skip(f"needs the real recording in {SHARED}")
    recording = read_recording(path)
    assert recording.sidecar.external
    assert recording.warnings == ()
    assert (recording.rows, recording.reference_axes) == (1203, ("z",))
    assert recording.scale_mm is None
    assert recording.approach is None
    assert recording.model_mm is not None
    assert not recording.model_mm.any()
    assert sorted(set(recording.fold.tolist())) == list(range(8))
    assert recording.visit is not None
    for visit in set(recording.visit.tolist()):
        assert len(set(recording.fold[recording.visit == visit].tolist())) == 1, "a visit stays in one fold"


def test_units_and_order(tmp_path: Path) -> None:
    text = set_cell(2, "joint_3_um", "-6.61")(
        set_cell(2, "frame_u6_um", "1.25")(set_cell(2, "frame_t1_um", "2.5")(csv_text()))
    )
    recording = read_recording(write_recording_files(tmp_path, text))
    assert recording.joint_mm is not None
    assert recording.frame_mm is not None
    assert recording.joint_mm[0, 2] == float("-0.00661"), "the very number that a gauge in mm delivers"
    assert recording.frame_mm[0, [0, 8]].tolist() == [0.0025, 0.00125]
    assert list(recording.quantities) == ["temperature_room_degC", "pressure_hPa"]
    assert recording.row[[0, -1]].tolist() == [2, 21]
    assert recording.session is not None
    assert recording.session.tolist() == [1] * 10 + [2] * 10


TOLERATED: dict[str, Edit] = {
    "byte order mark": lambda t: "\ufeff" + t,
    "Windows line ends": lambda t: t.replace("\n", "\r\n"),
    "spaces around cells": lambda t: t.replace(",", " , "),
    "trailing empty rows": lambda t: t + "," * (len(HEADER) - 1) + "\n" + "\n\n",
    "trailing empty columns": lambda t: t.replace("\n", ",,\n"),
    "quoted numbers": lambda t: t.replace("20.104", '"20.104"'),
    "no line end at the end": lambda t: t[:-1],
    "1.0 for a number": lambda t: t.replace("\n10,1,", "\n10.0,1.0,"),
}


@pytest.mark.parametrize("habit", TOLERATED)
def test_what_means_one_thing_only_is_taken(tmp_path: Path, habit: str) -> None:
    text = TOLERATED[habit](csv_text())
    assert text != csv_text()
    (tmp_path / "plain").mkdir()
    plain = read_recording(write_recording_files(tmp_path / "plain", csv_text()))
    recording = read_recording(write_recording_files(tmp_path, text))
    assert list(recording.columns) == list(plain.columns)
    assert all(np.array_equal(recording.columns[name], plain.columns[name]) for name in plain.columns)
    assert np.array_equal(recording.row, plain.row)
    assert recording.left_out == {}
    assert recording.warnings == ()


def test_empty_cells_are_left_out_where_needed_and_counted(tmp_path: Path) -> None:
    text = csv_text()
    for edit in (
        set_cell(4, "scale_2_mm", ""),
        set_cell(5, "scale_2_mm", ""),
        set_cell(5, "pressure_hPa", ""),
        set_cell(6, "time_s", ""),
        set_cell(9, "session", ""),
    ):
        text = edit(text)
    lines = text.split("\n")
    lines.insert(11, "")
    sidecar = SIDECAR + "excluded_rows: [{row: 5, reason: door}, {rows: 7-8, reason: beam cut}]\n"
    recording = read_recording(write_recording_files(tmp_path, "\n".join(lines), sidecar))
    assert recording.left_out == {"time_s is empty": 1, "empty row": 1}
    assert recording.rows == 19
    assert np.isfinite(recording.time_s).all()
    assert recording.row[recording.excluded].tolist() == [5, 7, 8]
    usable = recording.usable(["scale_2_mm", "pressure_hPa"])
    assert usable.left_out == {"excluded by a person": 3, "scale_2_mm is empty": 1}
    assert usable.mask.sum() == 15
    assert recording.usable(["scale_1_mm"]).mask.sum() == 16
    assert recording.session is not None
    assert recording.session[recording.row == 9] == -1
    assert recording.sidecar.excluded == {5: "door", 7: "beam cut", 8: "beam cut"}


def test_any_subset_of_axes_and_own_sigmas(tmp_path: Path) -> None:
    sidecar = SIDECAR.replace("0.15", "[0.1, 0.3]").replace("frame: machine", "frame: instrument")
    recording = read_recording(write_recording_files(tmp_path, drop_columns("reference_y_mm")(csv_text()), sidecar))
    assert recording.reference_axes == ("x", "z")
    assert recording.reference_mm is not None
    assert recording.reference_mm.shape == (20, 2)
    assert recording.reference_sigma_mm == pytest.approx([0.0001, 0.0003])
    assert recording.reference is not None
    assert recording.reference.frame == "instrument"
    unknown = read_recording(write_recording_files(tmp_path, csv_text(), SIDECAR.replace("  sigma_um: 0.15\n", "")))
    assert np.isnan(unknown.reference_sigma_mm).all()


def test_pose_with_attitude(tmp_path: Path) -> None:
    rows = csv_text().splitlines()
    rows = [
        rows[0] + ",reference_rx_rad,reference_ry_rad,reference_rz_rad",
        *(row + ",0.1,0.2,0.3" for row in rows[1:]),
    ]
    recording = read_recording(
        write_recording_files(tmp_path, "\n".join(rows), SIDECAR.replace("tool_position", "tool_pose"))
    )
    assert recording.reference_rotation_rad is not None
    assert recording.reference_rotation_rad[3].tolist() == [0.1, 0.2, 0.3]


def test_link_length_needs_no_frame(tmp_path: Path) -> None:
    frame = [name for name in HEADER if name.startswith("frame_")]
    text = rename_column("reference_x_mm", "reference_link_2_mm")(
        drop_columns("reference_y_mm", "reference_z_mm", *frame)(csv_text())
    )
    recording = read_recording(
        write_recording_files(tmp_path, text, "machine: tripod-cmm\nreference: {quantity: link_length}\n")
    )
    assert recording.reference_links == (2,)
    assert recording.reference_link_mm is not None
    assert recording.reference_link_mm.shape == (20, 1)
    assert recording.frame_mm is None
    assert recording.reference_mm is None


def test_ball_plate(tmp_path: Path) -> None:
    text = rename_column("pressure_hPa", "ball")(NO_REFERENCE(csv_text()).replace("1013.25", "17"))
    (tmp_path / "plate.csv").write_text("ball,x_mm,y_mm,z_mm\n18,0,0,0\n17,50.001,-50,0.5\n")
    sidecar = "machine: tripod-cmm\nreference: {quantity: ball_plate, balls: plate.csv}\n"
    recording = read_recording(write_recording_files(tmp_path, text, sidecar))
    assert recording.reference is not None
    assert recording.reference.frame == "instrument", "a plate's coordinates are its own"
    assert recording.reference_mm is not None
    assert recording.reference_mm[5].tolist() == [50.001, -50.0, 0.5]
    before = recording.sha256
    (tmp_path / "plate.csv").write_text("ball,x_mm,y_mm,z_mm\n18,0,0,0\n17,50.002,-50,0.5\n")
    assert read_recording(tmp_path / "run.csv").sha256 != before, "the plate is part of the provenance"


def test_external_model_needs_no_gauges(tmp_path: Path) -> None:
    text = "time_s,wind_m_per_s,model_x_mm,reference_x_mm\n0,1,2,3\n1,1,2,3.5\n"
    sidecar = SIDECAR.replace("tripod-cmm", "external")
    recording = read_recording(write_recording_files(tmp_path, text, sidecar))
    assert recording.model_mm is not None
    assert recording.model_mm.tolist() == [[2.0], [2.0]]
    assert list(recording.quantities) == ["wind_m_per_s"]


def test_points_may_have_names(tmp_path: Path) -> None:
    text = rename_column("visit", "point")(csv_text())
    lines = text.split("\n")
    lines[1:3] = [line.replace(",1,0,", ",1,P-07,") for line in lines[1:3]]
    recording = read_recording(write_recording_files(tmp_path, "\n".join(lines)))
    assert recording.point is not None
    assert recording.point[0] == recording.point[1] != recording.point[2]


def test_gauges_alone_are_for_join_only(tmp_path: Path) -> None:
    path = write_recording_files(tmp_path, NO_REFERENCE(csv_text()), "machine: tripod-cmm\n")
    with pytest.raises(RecordingError, match="compd recording join"):
        read_recording(path)
    assert read_recording(path, needs_reference=False).reference is None


def test_rows_count_in_the_order_of_time(tmp_path: Path) -> None:
    header, *lines = csv_text().splitlines()
    newest_first = "\n".join([header, *lines[::-1]])
    recording = read_recording(write_recording_files(tmp_path, newest_first))
    sorted_file = read_recording(write_recording_files(tmp_path, csv_text()))
    assert np.array_equal(recording.row, np.arange(21, 1, -1))
    assert recording.columns.keys() == sorted_file.columns.keys()
    assert all(np.array_equal(values, sorted_file.columns[name]) for name, values in recording.columns.items())
    assert recording.scale_mm is not None
    assert np.array_equal(recording.scale_mm[:, 0], sorted_file.columns["scale_1_mm"])
    assert "column time_s (A), rows 3, 4, 5 and 16 more rows: time runs backwards" in str(recording.warnings[0])


def test_implausible_values_are_warned_of_not_refused(tmp_path: Path) -> None:
    text = set_column("temperature_room_degC", "68")(set_cell(3, "joint_1_um", "5000")(csv_text()))
    warnings = "\n".join(str(warning) for warning in read_recording(write_recording_files(tmp_path, text)).warnings)
    assert "joint_1_um (G), row 3: implausible" in warnings
    assert "temperature_room_degC (Y), rows 2, 3, 4 and 17 more rows" in warnings


def test_unknown_unit_is_kept_and_warned_of(tmp_path: Path) -> None:
    recording = read_recording(
        write_recording_files(tmp_path, rename_column("pressure_hPa", "coolant_flow_foo")(csv_text()))
    )
    assert "coolant_flow_foo" in recording.quantities
    assert "ends in no unit that is known" in str(recording.warnings[0])


def test_gauges_are_counted_against_the_machine(tmp_path: Path) -> None:
    path = write_recording_files(tmp_path, drop_columns("joint_9_um")(csv_text()))
    with pytest.raises(RecordingError, match="8 joint comparator columns, tripod-cmm has 9"):
        read_recording(path, load(TRIPOD))


def test_check_prints_what_there_is(tmp_path: Path) -> None:
    result = CliRunner().invoke(recording_command, ["check", str(write_recording_files(tmp_path, csv_text()))])
    assert result.exit_code == 0
    assert "20 rows" in result.output
    assert "3 scales, 9 joint comparators, 9 frame comparators" in result.output


number = st.floats(-1000, 1000, allow_nan=False)


@settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_what_is_written_is_read_back(tmp_path: Path, data: st.DataObject) -> None:
    rows = data.draw(st.integers(2, 12))
    empty_or_number = st.one_of(st.just(math.nan), number)

    def drawn(cells: st.SearchStrategy[float]) -> np.ndarray:
        return np.array(data.draw(st.lists(cells, min_size=rows, max_size=rows)))

    columns = {"time_s": np.cumsum(drawn(st.floats(0.001, 100.0))).round(6)}
    columns |= {name: drawn(number) for name in HEADER if name.startswith(("scale", "joint", "frame"))}
    columns |= {"fan_speed_rpm": drawn(empty_or_number), "session": drawn(st.integers(0, 9))}
    columns |= {f"reference_{axis}_mm": drawn(number) for axis in "xyz"}
    columns |= {f"approach_{i}": drawn(st.sampled_from([-1.0, 1.0, math.nan])) for i in (1, 2, 3)}
    sidecar = {"machine": "tripod-cmm", "reference": {"quantity": "tool_position", "frame": "instrument"}}
    path = tmp_path / "round.csv"
    write_recording(path, columns, sidecar, overwrite=True)
    recording = read_recording(path)
    assert list(recording.columns) == list(columns)
    for name, values in columns.items():
        decimals = 6 if name.endswith("_um") else 9 if name.endswith("_mm") else 15
        np.testing.assert_array_equal(recording.columns[name], np.round(values, decimals) if decimals < 15 else values)
    assert [file.name for file in sorted(tmp_path.iterdir())] == ["round.csv", "round.yaml"]


def test_writer_refuses_and_leaves_nothing_behind(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    sidecar = {"machine": "tripod-cmm"}
    for columns, wanted in (
        ({"time_s": [0, 1], "scale_1_um": [1, 2]}, "no column of the format"),
        ({"time_s": [0, 1], "scale_1_mm": [1]}, "not as long as the others"),
        ({"time_s": [0, 0], "scale_1_mm": [1, 2]}, "does not rise"),
        ({"time_s": [0, math.nan], "scale_1_mm": [1, 2]}, "does not rise"),
        ({"time_s": [0, 1], "scale_1_mm": [1, math.inf]}, "infinite"),
    ):
        with pytest.raises(RecordingError, match=wanted):
            write_recording(path, columns, sidecar)
        assert list(tmp_path.iterdir()) == []
    path.write_text("mine")
    with pytest.raises(RecordingError, match="is there already"):
        write_recording(path, {"time_s": [0, 1]}, sidecar)
    assert path.read_text() == "mine"
    with pytest.raises(RecordingError, match="cannot be written to"):
        write_recording(tmp_path / "nowhere" / "run.csv", {"time_s": [0, 1]}, sidecar)


def test_failed_second_file_leaves_what_was_there(tmp_path: Path) -> None:
    """The CSV's place is taken by a directory: nothing can be renamed onto it."""
    path = tmp_path / "run.csv"
    path.mkdir()
    (path / "keep").touch()
    with pytest.raises(RecordingError, match="cannot be written to"):
        write_recording(path, {"time_s": [0, 1]}, {"machine": "x"}, overwrite=True)
    assert [file.name for file in sorted(tmp_path.iterdir())] == ["run.csv"]


def test_a_sidecar_without_a_format_is_format_1_and_what_is_written_is_format_3(tmp_path: Path) -> None:
    first = read_recording(write_recording_files(tmp_path, csv_text()))
    assert first.sidecar.format == 1
    write_recording(tmp_path / "again.csv", first.columns, sidecar_contents("tripod-cmm", {"quantity": "link_length"}))
    text = (tmp_path / "again.yaml").read_text()
    assert text == "format: 3\nmachine: tripod-cmm\nreference:\n  quantity: link_length\n"


def test_the_sidecar_says_from_which_quantities_effects_count(tmp_path: Path) -> None:
    plain = read_recording(write_recording_files(tmp_path, csv_text()))
    assert plain.sidecar.quantities_at_zero is None
    assert plain.sidecar.counts_from.startswith("20 degC")
    at_zero = "quantities_at_zero: {temperature_room_degC: 23, pressure_hPa: 987.5}\n"
    known = read_recording(write_recording_files(tmp_path, csv_text(), SIDECAR + at_zero))
    assert known.sidecar.quantities_at_zero == {"temperature_room_degC": 23.0, "pressure_hPa": 987.5}
    assert known.sidecar.counts_from == "machine zero"
    contents = sidecar_contents("tripod-cmm", {"quantity": "tool_position", "frame": "machine"}, quantities_at_zero={})
    write_recording(tmp_path / "again.csv", plain.columns, contents)
    assert read_recording(tmp_path / "again.csv").sidecar.quantities_at_zero == {}, "which is not the same as no key"


@pytest.mark.parametrize("wrong", ["{temperature_room_degC: warm}", "{a_degC: .nan}", "[1, 2]", "{a_degC: true}", "5"])
def test_quantities_at_zero_are_numbers_by_name(tmp_path: Path, wrong: str) -> None:
    path = write_recording_files(tmp_path, csv_text(), SIDECAR + f"quantities_at_zero: {wrong}\n")
    with pytest.raises(RecordingError, match="is no mapping of quantities to numbers"):
        read_recording(path)
