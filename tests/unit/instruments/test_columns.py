"""What the columns are: as a person says, by the header, by the numbers, or asked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.errors import RecordingError
from tests.unit.instruments.reading import read, refused


@pytest.mark.parametrize(
    ("header", "roles"),
    [
        ("Time [s],X [mm],Y [mm],Z [mm]", "time x y z"),
        ("Zeit (s),Tracker X in mm,Tracker Y in mm,Tracker Z in mm", "time x y z"),
        ("elapsed_ms,X / inch,Y / inch,Z / inch", "time x y z"),
        ("Punkt,X_Ist mm,X_Soll mm,X_Abweichung mm", "name x - -"),
        ("No.,Actual X [um],Nominal X [um],Dev X [um]", "name x - -"),
        ("t_s,Länge [mm],temperature_degC,x_sigma_um", "time length - -"),
        ("t_s,Distance (m),humidity_pct,count", "time length - -"),
        ("ID,x_ft,y_ft,Remark", "name x y -"),
        ("time_s,link_1_mm,a,b", "time length - -"),
    ],
)
def test_roles_by_the_header(tmp_path: Path, header: str, roles: str) -> None:
    export = read(tmp_path, f"{header}\n1.5,2,3,4\n2.5,3,4,5\n")
    found = {role for role in roles.split() if role != "-"}
    assert set(export.axes) == found - {"time", "name"}
    assert (export.time_s is not None) == ("time" in found)
    assert (export.name is not None) == ("name" in found)
    for k, role in enumerate(roles.split()):
        if role == "-":
            assert f"column {k + 1} {header.split(',')[k]!r}" in export.taken["not used"]
        else:
            assert export.taken[role].startswith(f"column {k + 1} {header.split(',')[k]!r}, by its name")


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        *(("mm", 1.0), ("Millimeters", 1.0), ("um", 1e-3), ("µm", 1e-3), ("m", 1e3), ("cm", 10.0)),
        *(("inch", 25.4), ("Inches", 25.4), ("in", 25.4), ("ft", 304.8), ("feet", 304.8)),
    ],
)
def test_units_of_length(tmp_path: Path, unit: str, factor: float) -> None:
    for text, said in ((f"x [{unit}],y [{unit}]\n1,2\n", {}), ("x,y\n1,2\n", {"unit": unit})):
        np.testing.assert_allclose(read(tmp_path, text, **said).values, [[factor, 2 * factor]])


def test_an_attitude_is_a_rotation_vector_in_its_unit(tmp_path: Path) -> None:
    header = "time_s,x_mm,y_mm,z_mm,Rx [deg],Ry [deg],Rz [deg]"
    export = read(tmp_path, f"{header}\n1,1,2,3,90,0,-45\n")
    assert export.axes == ("x", "y", "z", "rx", "ry", "rz")
    np.testing.assert_allclose(export.values, [[1, 2, 3, np.pi / 2, 0, -np.pi / 4]])
    bare = header.replace(" [deg]", "")
    assert "--angle-unit rad or --angle-unit deg" in refused(tmp_path, f"{bare}\n1,1,2,3,90,0,-45\n")
    same = read(tmp_path, f"{bare}\n1,1,2,3,90,0,-45\n", angle_unit="deg")
    np.testing.assert_allclose(same.values, export.values)
    question = refused(tmp_path, "time_s,x_mm,y_mm,z_mm,Roll,Pitch,Yaw\n1,1,2,3,90,0,-45\n")
    assert "--columns time,x,y,z,-,-,-" in question
    assert "an attitude is not whole" in refused(tmp_path, "x_mm,y_mm,z_mm,rx_rad\n1,2,3,4\n")


@pytest.mark.parametrize(
    ("rows", "said", "roles"),
    [
        ("1 1.5 2.5 3.5\n2 1.5 2.5 3.5\n1 1.5 2.5 3.5\n", {}, "name x y z"),
        ("0.0 1.5 2.5 3.5\n0.1 1.5 2.5 3.5\n0.2 1.5 2.5 3.5\n", {}, "time x y z"),
        ("1.5 2.5 3.5\n1.5 2.5 3.5\n", {}, "x y z"),
        ("P1 1.5 2.5 3.5\nP2 1.5 2.5 3.5\n", {}, "name x y z"),
        ("P1,1.5,2.5,3.5,12.02.2025 16:56:08.1\nP2,1.5,2.5,3.5,12.02.2025 16:56:09.1\n", {}, "name x y z time"),
        ("1,1.5,2.5,3.5,16:56:08.1\n2,1.5,2.5,3.5,16:56:09.1\n", {}, "name x y z time"),
        ("1 1.5 2.5 3.5\n2 1.5 2.5 3.5\n", {"rate_hz": 10.0}, "name x y z"),
        ("1 1.5 2.5 3.5\n2 1.5 2.5 3.5\n", {"columns": ("name", "x", "y", "z")}, "name x y z"),
        ("1 1.5 2.5 3.5\n2 1.5 2.5 3.5\n", {"columns": ("time[s]", "x", "-", "z")}, "time x - z"),
        ("1 1.5 2.5 3.5\n2 1.5 2.5 3.5\n", {"shape": "sa"}, "name x y z"),
        ("1 1.5 2.5 3.5\n2 1.5 2.5 3.5\n", {"names": {"length": "2"}}, "- length - -"),
    ],
)
def test_roles_by_the_numbers(tmp_path: Path, rows: str, said: dict[str, Any], roles: str) -> None:
    export = read(tmp_path, rows, unit="mm", **said)
    found = set(roles.split()) - {"-"}
    assert set(export.axes) == found - {"time", "name"}
    assert (export.name is not None) == ("name" in found)
    assert (export.time_s is not None) == ("time" in found or "rate_hz" in said)
    for role in found:
        assert export.taken[role].startswith(f"column {roles.split().index(role) + 1}")


@pytest.mark.parametrize(
    ("rows", "answers"),
    [
        ("0 1.5 2.5 3.5\n1 1.5 2.5 3.5\n2 1.5 2.5 3.5\n", ["--columns name,x,y,z or --columns time,x,y,z"]),
        ("P 1 1.5 2.5 3.5\nP 2 1.5 2.5 3.5\n", ["--columns name,-,x,y,z or --columns name,time,x,y,z"]),
        ("0.5 1.5\n1.5 1.6\n", ["--columns time,length or --columns time,x"]),
        ("1.5 2.5 3.5 1.0 2.0 3.0\n", ["--columns with 6 of time"]),
        ("A P1 1.5 2.5 3.5\nA P2 1.5 2.5 3.5\n", ["--columns with 5 of time", "name,name,x,y,z"]),
    ],
)
def test_two_readings_are_asked_about(tmp_path: Path, rows: str, answers: list[str]) -> None:
    question = refused(tmp_path, rows, unit="mm")
    assert "what its columns are cannot be told" in question
    for answer in answers:
        assert answer in question


@pytest.mark.parametrize(
    ("text", "said", "wanted"),
    [
        ("x,y\n1,2\n", {}, "no unit of x"),
        ("x_mm,y_in\n1,2\n", {}, "units are mixed: mm by the name of x, inch by the name of y"),
        ("x_mm,y\n1,2\n", {}, "y has no unit, where others have one"),
        ("x_mm,y_mm\n1,2\n", {"unit": "inch"}, "units are mixed: mm by the name of x, inch by --unit"),
        ("x,y\n1,2\n", {"unit": "deg"}, "is no unit of length"),
        ("x_mm,raw_x_mm\n1,2\n", {}, "2 columns may be x"),
        ("x_mm,y_mm\n1,2\n", {"columns": ("x",)}, "--columns has 1 roles, the rows have 2 cells"),
        ("x_mm,y_mm\n1,2\n", {"columns": ("x", "w")}, "--columns: column 2 has no such role"),
        ("x_mm,y_mm\n1,2\n", {"columns": ("x", "x")}, "--columns: two columns are x"),
        ("x_mm,y_mm\n1,2\n", {"names": {"x": "w"}}, "has no column for x"),
        ("a,b\n1,2\n", {}, "no column is a position or a length"),
        ("x_mm,y_mm\n1,2\n", {"shape": "pdf"}, "--as names no shape"),
        ("x_mm,y_mm\n1,2\n", {"group": "A"}, "has no column of groups"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, text: str, said: dict[str, Any], wanted: str) -> None:
    assert wanted in refused(tmp_path, text, **said)


GROUPS = "Group,Name,x_mm,y_mm\nA,1,1,2\nB,1,3,4\nA,2,5,6\n"


def test_groups_are_chosen_and_never_mixed_silently(tmp_path: Path) -> None:
    question = refused(tmp_path, GROUPS)
    assert "has 2 groups" in question
    assert "A (2 rows), B (1 row)" in question
    assert "--group all" in question
    one = read(tmp_path, GROUPS, group="A")
    assert one.name == ("1", "2")
    assert one.left_out == {"of other groups": 1}
    every = read(tmp_path, GROUPS, group="all")
    assert every.name == ("A::1", "B::1", "A::2")
    assert "has no such group" in refused(tmp_path, GROUPS, group="C")
    assert read(tmp_path, GROUPS.replace("B", "A")).name == ("1", "1", "2")


@pytest.mark.parametrize(
    "names",
    [
        ("X", "Y", "Z", "Xm", "Ym", "Zm"),
        ("x_mm", "y_mm", "z_mm", "mx_mm", "my_mm", "mz_mm"),
        ("X", "Y", "Z", "X2", "Y2", "Z2"),
        ("X", "Y", "Z", "Tx1", "Ty1", "Tz1"),
    ],
)
def test_two_triples_of_like_names_are_asked_about(tmp_path: Path, names: tuple[str, ...]) -> None:
    places = np.random.default_rng(1).uniform(-200.0, 200.0, (12, 3))
    rows = [",".join([*(f"{v:.0f}" for v in place), *(f"{v + 0.01:.6f}" for v in place)]) for place in places]
    text = "\n".join([",".join(names), *rows]) + "\n"
    message = refused(tmp_path, text, unit="mm")
    assert "two triples of columns may be the position" in message
    assert f"--x {names[3]} --y {names[4]} --z {names[5]}" in message
    export = read(tmp_path, text, unit="mm", names=dict(zip("xyz", names[3:], strict=True)))
    np.testing.assert_allclose(export.values, places + 0.01, atol=1e-6)


@pytest.mark.parametrize(
    "names",
    [
        ("X", "Y", "Z", "Nominal X", "Nominal Y", "Nominal Z"),
        ("X", "Y", "Z", "Xnom", "Ynom", "Znom"),
        ("X", "Y", "Z", "xa", "ya", "wa"),
    ],
)
def test_what_a_name_says_is_not_asked(tmp_path: Path, names: tuple[str, ...]) -> None:
    places = np.random.default_rng(1).uniform(-200.0, 200.0, (12, 3))
    rows = [",".join([*(f"{v + 0.01:.6f}" for v in place), *(f"{v:.0f}" for v in place)]) for place in places]
    export = read(tmp_path, "\n".join([",".join(names), *rows]) + "\n", unit="mm")
    np.testing.assert_allclose(export.values, places + 0.01, atol=1e-6)


def test_deviations_beside_a_position_are_not_asked_about(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    rows = [",".join(f"{v:.4f}" for v in [*rng.uniform(-200, 200, 3), *rng.normal(0, 0.01, 3)]) for _ in range(12)]
    assert len(read(tmp_path, "\n".join(["X,Y,Z,dX,dY,dZ", *rows]) + "\n", unit="mm").values) == 12


def test_an_attitude_in_angles_turns_in_the_order_that_is_said(tmp_path: Path) -> None:
    """Roll, pitch and yaw are those about x, y and z; a quarter about x, then one about z: the cyclic permutation."""
    header = "name,x_mm,y_mm,z_mm,Roll [deg],Pitch [deg],Yaw [deg]"
    export = read(tmp_path, f"{header}\nP1,1,2,3,90,0,90\nP2,1,2,3,0,0,30\n", angles="xyz")
    third = 2 * np.pi / 3 / np.sqrt(3)
    assert export.values[:, 3:] == pytest.approx(np.array([[third] * 3, [0, 0, np.pi / 6]]))
    assert "in the order xyz" in export.taken["rx"]
    turned = read(tmp_path, f"{header}\nP1,1,2,3,90,0,90\n", angles="XYZ")
    assert turned.values[0, 3:] == pytest.approx([third, -third, third])
    with pytest.raises(RecordingError, match=r"no order of turning(.|\n)*value: --angles rpy"):
        read(tmp_path, f"{header}\nP1,1,2,3,90,0,90\n", angles="rpy")
    with pytest.raises(RecordingError, match=r"meaning cannot be told(.|\n)*--angles"):
        read(tmp_path, f"{header}\nP1,1,2,3,90,0,90\n")
