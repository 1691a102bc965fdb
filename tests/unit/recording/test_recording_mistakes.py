"""Every mistake that a spreadsheet's export makes: refused in words, with row, column, value and what to do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from compd.cli.measurements.recording.recording import recording as recording_command
from compd.configuration import load
from compd.errors import RecordingError
from compd.recording.reader import read_recording
from tests.support.paths import ROOT
from tests.support.recordings import (
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
HEXAPOD = TRIPOD.with_name("hexapod.yaml")


def problems_of(path: Path) -> list[str]:
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    return [str(problem) for problem in caught.value.problems]


def lines_of(text: str) -> list[str]:
    return text.split("\n")


MISTAKES: dict[str, tuple[Edit, list[str]]] = {
    "text": (set_cell(7, "joint_4_um", "abc"), ["column joint_4_um (J), row 7: text", "'abc'", "empty the cell"]),
    "a spreadsheet's error": (set_cell(3, "scale_1_mm", "#REF!"), ["scale_1_mm (D), row 3", "a spreadsheet's error"]),
    "#N/A": (set_cell(3, "scale_1_mm", "#N/A"), ["spreadsheet's error", "'#N/A'"]),
    "dash": (set_cell(3, "pressure_hPa", "-"), ["row 3", "missing value", "'-'", "empty the cell"]),
    "n/a": (set_cell(3, "pressure_hPa", "n/a"), ["missing value", "'n/a'"]),
    "NaN": (set_cell(3, "pressure_hPa", "NaN"), ["missing value", "'NaN'"]),
    "inf": (set_cell(3, "pressure_hPa", "inf"), ["not a finite number"]),
    "too large": (set_cell(3, "pressure_hPa", "1e999"), ["not a finite number"]),
    "SCPI's infinity": (set_cell(3, "pressure_hPa", "-9.9E37"), ["row 3: stands for no number", "empty the cell"]),
    "SCPI's not-a-number": (set_cell(7, "reference_x_mm", "9.91E37"), ["row 7: stands for no number"]),
    "a date": (set_cell(3, "time_s", "2026-11-20 12:00:01"), ["column time_s (A), row 3: a date", "=(A2-A$2)*86400"]),
    "a time of day": (set_cell(3, "time_s", "12:00:01"), ["a time of day"]),
    "unit in a cell": (set_cell(3, "temperature_room_degC", "20.1 °C"), ["a unit behind the number", "20.1 °C"]),
    "decimal comma": (set_cell(3, "temperature_room_degC", '"20,1"'), ["decimal comma", "'20,1'", "`.`"]),
    "ambiguous comma": (set_cell(3, "scale_1_mm", '"20,123"'), ["may be a decimal or a thousands mark"]),
    "thousands": (set_cell(3, "pressure_hPa", '"1,013.25"'), ["thousands separator", "1,013.25"]),
    "thousands by spaces": (set_cell(3, "pressure_hPa", "1 013.25"), ["thousands separator"]),
    "typographic minus": (set_cell(3, "scale_1_mm", "\u221212.5"), ["typographic minus"]),
    "underscore": (set_cell(3, "scale_1_mm", "1_0"), ["text where a number belongs"]),
    "clock begun again": (
        set_cell(15, "time_s", "25"),
        ["column time_s (A), row 15: time runs backwards, and sessions overlap", "'25'", "let the clock run on"],
    ),
    "time repeated": (set_cell(5, "time_s", "20"), ["row 5: the same time as another row"]),
    "session 1.5": (set_cell(5, "session", "1.5"), ["session (B), row 5: not a whole number", "'1.5'"]),
    "visit -3": (set_cell(5, "visit", "-3"), ["visit (C), row 5", "'-3'"]),
    "scale in um": (rename_column("scale_1_mm", "scale_1_um"), ["is in um by its name", "divide the values by 1000"]),
    "joint in mm": (
        rename_column("joint_1_um", "joint_1_mm"),
        ["is in mm", "multiply the values by 1000", "joint_1_um"],
    ),
    "reference in um": (rename_column("reference_x_mm", "reference_x_um"), ["is in um", "reference_x_mm"]),
    "degC as C": (rename_column("room_degC", "room_C"), ["is in C", "the values stay", "temperature_room_degC"]),
    "degrees F": (rename_column("room_degC", "room_degF"), ["is in degF", "(value - 32) / 1.8"]),
    "kelvin": (rename_column("room_degC", "room_K"), ["value - 273.15"]),
    "pressure in Pa": (rename_column("pressure_hPa", "pressure_Pa"), ["divide the values by 100"]),
    "time in ms": (rename_column("time_s", "time_ms"), ["is in ms", "divide the values by 1000"]),
    "time without unit": (rename_column("time_s", "time"), ["has no unit in its name", "time_s"]),
    "spaces in a name": (rename_column("scale_1_mm", "scale 1 mm"), ["not spelt", "name it scale_1_mm"]),
    "brackets in a name": (rename_column("scale_1_mm", "Scale 1 [mm]"), ["not spelt", "name it scale_1_mm"]),
    "capitals": (rename_column("scale_1_mm", "SCALE_1_MM"), ["not spelt", "name it scale_1_mm"]),
    "no format column": (rename_column("pressure_hPa", "remarks"), ["column remarks (Z): no column of the format"]),
    "scale 0": (rename_column("scale_1_mm", "scale_0_mm"), ["scale_0_mm (D): no column", "missing: scale_1_mm"]),
    "model with a machine": (rename_column("pressure_hPa", "model_x_mm"), ["the sidecar names a machine"]),
    "missing scale": (drop_columns("scale_2_mm"), ["missing: scale_2_mm"]),
    "no scales": (drop_columns("scale_1_mm", "scale_2_mm", "scale_3_mm"), ["missing: scale_1_mm"]),
    "missing joint": (drop_columns("joint_4_um"), ["missing: joint_4_um"]),
    "missing frame": (drop_columns("frame_t1_um", "frame_u6_um"), ["columns are missing: frame_t1_um, frame_u6_um"]),
    "missing reference": (
        drop_columns("reference_x_mm", "reference_y_mm", "reference_z_mm"),
        ["missing: reference_x_mm, reference_y_mm"],
    ),
    "duplicate name": (rename_column("scale_2_mm", "scale_1_mm"), ["columns D and E: two columns of the same name"]),
    "cells without a name": (
        lambda t: "\n".join(line + (",7" if i in (1, 5) else ",") for i, line in enumerate(lines_of(t)[:-1])),
        ["column AD, rows 2 and 6: cells under no name"],
    ),
    "units row": (
        lambda t: t.replace("\n", "\n" + ",".join(["[s]", "", ""] + ["[mm]"] * 3 + ["[um]"] * 22) + "\n", 1),
        ["row 2: units or text under the header", "delete the row"],
    ),
    "title above the header": (lambda t: "Run 7,3 May\n\n" + t, ["row 3: the header is not in row 1", "rows 1 and 2"]),
    "no header": (lambda t: t.split("\n", 1)[1], ["row 1: numbers where the header belongs"]),
    "cut row": (lambda t: t[:-60], ["row 21: fewer cells than the header"]),
    "unquoted decimal commas": (lambda t: t.replace("20.104", "20,104", 1), ["row 2: more cells than the header"]),
    "unclosed quote": (set_cell(4, "scale_1_mm", '"1.5'), ["not CSV", "mend the quotes"]),
    "one row": (lambda t: "\n".join(lines_of(t)[:2]) + "\n", ["only one row"]),
    "no rows": (lambda t: lines_of(t)[0] + "\n", ["no rows"]),
    "empty file": (lambda _: "", ["is empty"]),
    "empty column": (set_column("scale_2_mm", ""), ["no row of 20 can be used: 20 without scale_2_mm"]),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake_is_refused_in_words(tmp_path: Path, mistake: str) -> None:
    edit, wanted = MISTAKES[mistake]
    text = edit(csv_text())
    assert text != csv_text(), "the edit must change the file"
    problems = problems_of(write_recording_files(tmp_path, text))
    message = "\n".join(problems)
    for part in wanted:
        assert part in message
    assert str(tmp_path / "run.csv") in message
    assert len(problems) <= 2, "one mistake is reported once"


SIDECARS: dict[str, tuple[str, list[str]]] = {
    "unknown key": (SIDECAR + "machin: x\n", ["run.yaml:6 machin: unknown key", "did you mean `machine`?"]),
    "no machine": (SIDECAR.replace("machine: tripod-cmm\n", ""), ["names no machine"]),
    "no reference": ("machine: tripod-cmm\n", ["names no reference", "compd recording join"]),
    "no reference of a model of one's own": (
        "machine: external\n",
        ["names no reference", "write reference: {quantity"],
    ),
    "unknown quantity": (SIDECAR.replace("tool_position", "tip"), ["quantity", "'tip'", "tool_pose, link_length"]),
    "no frame": (SIDECAR.replace("  frame: machine\n", ""), ["reference.frame: is missing", "machine, instrument"]),
    "sigma 0": (SIDECAR.replace("0.15", "0"), ["sigma_um", "greater than 0"]),
    "two sigmas": (SIDECAR.replace("0.15", "[0.1, 0.2]"), ["sigma_um has 2 values for 3"]),
    "no plate": (SIDECAR.replace("tool_position", "ball_plate"), ["reference.balls: is missing"]),
    "pose without attitude": (SIDECAR.replace("tool_position", "tool_pose"), ["missing: reference_rx_rad"]),
    "other quantity": (SIDECAR.replace("tool_position", "link_length"), ["not a column of the quantity"]),
    "no reason": (SIDECAR + "excluded_rows: [5]\n", ["excluded_rows[1]: has no reason"]),
    "no such row": (SIDECAR + "excluded_rows: [{row: 99, reason: door}]\n", ["row 99", "no such row", "rows 2 to 21"]),
    "all rows": (SIDECAR + "excluded_rows: [{rows: 2-21, reason: door}]\n", ["no row of 20", "20 excluded"]),
    "external": (SIDECAR.replace("tripod-cmm", "external"), ["missing: model_x_mm, model_y_mm, model_z_mm"]),
    "format 0": ("format: 0\n" + SIDECAR, ["run.yaml:1 format: is no format number", "1 to 3"]),
    "row 1": (
        SIDECAR + "excluded_rows: [{row: 1, reason: door}]\n",
        ["run.yaml:6 excluded_rows[1].row", "names no row"],
    ),
    "not YAML": ("machine: [\n", ["not YAML"]),
}


@pytest.mark.parametrize("mistake", SIDECARS)
def test_sidecar_is_refused_in_words(tmp_path: Path, mistake: str) -> None:
    sidecar, wanted = SIDECARS[mistake]
    message = "\n".join(problems_of(write_recording_files(tmp_path, csv_text(), sidecar)))
    for part in wanted:
        assert part in message


def test_every_mistake_of_a_sidecar_comes_at_once_with_its_line(tmp_path: Path) -> None:
    sidecar = "format: two\nreference:\n  quantity: tip\n  frame: tracker\n  sigma_um: -1\n"
    sidecar += "excluded_rows:\n- {row: 5}\nnotes: 3\n"
    problems = [problem.split(": ")[0] for problem in problems_of(write_recording_files(tmp_path, csv_text(), sidecar))]
    path = tmp_path / "run.yaml"
    assert problems == [
        f"{path}:1 format",
        f"{path}:1 machine",
        f"{path}:3 reference.quantity",
        f"{path}:4 reference.frame",
        f"{path}:5 reference.sigma_um",
        f"{path}:7 excluded_rows[1].reason",
        f"{path}:8 notes",
    ]


def test_a_newer_format_is_refused_and_nothing_else_judged(tmp_path: Path) -> None:
    (problem,) = problems_of(
        write_recording_files(tmp_path, "no table\n", "format: 4\nmachine: tripod-cmm\nsomething_new: 5\n")
    )
    assert "run.yaml:1 format: was written by a newer release" in problem
    assert "update compd" in problem


def test_missing_sidecar_does_not_hide_the_rows_mistakes(tmp_path: Path) -> None:
    path = write_recording_files(tmp_path, set_cell(7, "joint_4_um", "abc")(csv_text()))
    path.with_suffix(".yaml").unlink()
    message = "\n".join(problems_of(path))
    assert "the sidecar is missing" in message
    assert "`machine: external` for columns model_" in message
    assert "joint_4_um (J), row 7" in message


def test_every_problem_comes_in_one_message(tmp_path: Path) -> None:
    text = csv_text()
    for edit in (
        set_cell(3, "scale_1_mm", "#REF!"),
        set_cell(9, "session", "0.5"),
        set_cell(12, "time_s", "3"),
        rename_column("joint_7_um", "joint_7_mm"),
        rename_column("room_degC", "room_F"),
    ):
        text = edit(text)
    path = write_recording_files(
        tmp_path, text, SIDECAR.replace("machine\n  sigma_um: 0.15", "tracker\n  sigma_um: good")
    )
    message = "\n".join(problems_of(path))
    for part in ("#REF!", "'0.5'", "time runs backwards", "joint_7_um", "room_degC", "'tracker'", "'good'"):
        assert part in message


def test_equal_problems_are_summed_up(tmp_path: Path) -> None:
    (problem,) = problems_of(write_recording_files(tmp_path, set_column("joint_2_um", "n/a")(csv_text(415))))
    assert "column joint_2_um (H), rows 2, 3, 4 and 412 more rows" in problem
    assert problem.count("'n/a'") == 1


def test_german_spreadsheet_gets_two_problems_not_ninety(tmp_path: Path) -> None:
    text = csv_text(separator=";").replace(".", ",")
    problems = problems_of(write_recording_files(tmp_path, text))
    assert len(problems) == 2
    assert "separated by semicolons" in problems[0]
    assert "decimal comma" in problems[1]
    assert "pressure_hPa (Z)" in problems[1]


@pytest.mark.parametrize(
    ("content", "wanted"),
    [
        (b"PK\x03\x04rest", "save as CSV"),
        ("time_s,scale_1_mm\n0,1\n".encode("utf-16"), "UTF-16"),
        (csv_text().replace("room_degC", "room_°C").encode("cp1252"), "not UTF-8"),
    ],
)
def test_file_of_another_kind(tmp_path: Path, content: bytes, wanted: str) -> None:
    assert wanted in "\n".join(problems_of(write_recording_files(tmp_path, content)))


@pytest.mark.long
@pytest.mark.sample
@settings(max_examples=150, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_nothing_but_words_comes_of_any_file(tmp_path: Path, data: st.DataObject) -> None:
    """Whatever a file holds, it is read or refused as a RecordingError: no other exception."""
    text = csv_text(4)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text)))
        cut = data.draw(st.integers(0, 30))
        text = text[:at] + data.draw(st.text("0,;\n\r\t\"'#.-eE_x \u00b0\u2212\x00", max_size=6)) + text[at + cut :]
    sidecar = data.draw(st.sampled_from([SIDECAR, SIDECAR[1:], SIDECAR[:40], SIDECAR + "excluded_rows: [{rows: 3-4}]"]))
    try:
        recording = read_recording(write_recording_files(tmp_path, text, sidecar))
    except RecordingError:
        return
    assert np.isfinite(recording.time_s).all()
    assert (np.diff(recording.time_s) > 0).all()


def test_ball_plate_mistakes(tmp_path: Path) -> None:
    text = drop_columns("reference_x_mm", "reference_y_mm", "reference_z_mm")(
        rename_column("pressure_hPa", "ball")(csv_text())
    )
    sidecar = "machine: tripod-cmm\nreference: {quantity: ball_plate, balls: plate.csv}\n"
    path = write_recording_files(tmp_path, text.replace("1013.25", "17"), sidecar)
    assert "plate.csv: cannot be read" in "\n".join(problems_of(path))
    (tmp_path / "plate.csv").write_text("ball,x_mm,y_mm,z_mm\n1,0,0,0\n2,50,0,\n2,50,0,0\n")
    message = "\n".join(problems_of(path))
    assert "column z_mm (D), row 3: empty" in message
    assert "ball 2 comes twice" in message
    (tmp_path / "plate.csv").write_text("ball,x_mm,y_mm,z_mm\n1,0,0,0\n2,50,0,0\n")
    assert "no such ball on the plate" in "\n".join(problems_of(path))


def test_sidecar_of_another_machine(tmp_path: Path) -> None:
    path = write_recording_files(tmp_path, csv_text())
    with pytest.raises(RecordingError) as caught:
        read_recording(path, load(HEXAPOD))
    message = str(caught.value)
    assert "the sidecar is for another machine" in message
    assert "3 scale columns, hexapod has 6" in message
    assert read_recording(path, load(TRIPOD)).machine == "tripod-cmm"


@pytest.mark.parametrize(("machine", "wanted"), [("hexapod", "hexapod has 6"), ("tripod-cm", "--machine PATH")])
def test_check_finds_the_machine_that_the_sidecar_names(tmp_path: Path, machine: str, wanted: str) -> None:
    path = write_recording_files(tmp_path, csv_text(), SIDECAR.replace("tripod-cmm", machine))
    result = CliRunner().invoke(recording_command, ["check", str(path)])
    assert isinstance(result.exception, RecordingError)
    assert wanted in str(result.exception)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["run.csv", "run.yaml"]
