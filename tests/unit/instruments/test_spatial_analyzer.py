"""SpatialAnalyzer's ASCII exports: what their comments say, groups, stamps of whole seconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.instruments.track import track_of
from tests.unit.instruments.reading import read, refused

HEAD = (
    "// SpatialAnalyzer SA 2025.1 ( x64 )  \n// Points Relative to Coordinate Frame 'Cell::BASE'\n"
    "// AXES = CARTESIAN: X,  Y,  Z (mm)\n"
)


def rows(group: str, count: int, minute: int = 52, step: float = 0.5) -> str:
    """Rows of one group, four in a second."""
    return "".join(
        f"Cell,  {group},  {i},  {i * step:.6f},  -2.5,  3.25,  02/12/25 16:{minute}:{10 + i // 4}\n"
        for i in range(count)
    )


def test_unit_frame_and_columns_are_in_the_file(tmp_path: Path) -> None:
    export = read(tmp_path, HEAD + rows("P1", 8))
    assert (export.shape, export.axes) == ("sa", ("x", "y", "z"))
    assert export.taken["frame"] == "Cell::BASE"
    assert export.taken["x"] == "column 4, as this shape has it, mm by the file's header"
    np.testing.assert_allclose(export.values[3], [1.5, -2.5, 3.25])
    assert export.name == tuple("01234567")
    assert export.line.tolist() == list(range(4, 12))
    track = track_of(export)
    assert track.time_std_s == pytest.approx(0.2887, abs=1e-4)
    np.testing.assert_allclose(np.diff(track.time_s), 0.25)


@pytest.mark.parametrize(
    ("row", "roles"),
    [
        ("Cell, P1, 0, 1.0, 2.0, 3.0", "collection group name x y z"),
        ("P1, 0, 1.0, 2.0, 3.0", "group name x y z"),
        ("0, 1.0, 2.0, 3.0", "name x y z"),
        ("0, 1.0, 2.0, 3.0, 02/12/25 16:52:10", "name x y z time"),
    ],
)
def test_fewer_columns_are_the_last_of_them(tmp_path: Path, row: str, roles: str) -> None:
    export = read(tmp_path, HEAD.replace("(mm)", "(inch)") + f"{row}\n{row}\n")
    for k, role in enumerate(roles.split()):
        assert export.taken[role].startswith(f"column {k + 1},")
    np.testing.assert_allclose(export.values, [[25.4, 50.8, 76.2]] * 2)


def test_a_stray_row_of_another_group_is_asked_about(tmp_path: Path) -> None:
    text = HEAD + rows("setup", 1, minute=20) + rows("P1", 40)
    assert "P1 (40 rows), setup (1 row)" in refused(tmp_path, text)
    assert len(read(tmp_path, text, group="P1").line) == 40
    assert len(read(tmp_path, text, group="all").line) == 41


def test_collections_with_groups_of_one_name_are_told_apart(tmp_path: Path) -> None:
    text = HEAD + rows("P1", 2) + rows("P1", 3).replace("Cell", "Other")
    assert "Other::P1 (3 rows), Cell::P1 (2 rows)" in refused(tmp_path, text)
    assert len(read(tmp_path, text, group="Cell::P1").line) == 2
    assert "has no such group, or several" in refused(tmp_path, text, group="P1")


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (
            HEAD.replace("CARTESIAN: X,  Y,  Z", "CYLINDRICAL: R,  T,  Z") + rows("P1", 3),
            "export.txt:3: the axes are not",
        ),
        (HEAD.replace("mm", "cubits") + rows("P1", 3), "export.txt:3: the unit is not known"),
        (HEAD + rows("P1", 3) + HEAD.replace("mm", "inch") + rows("P1", 3), "export.txt:9: units are mixed"),
        (HEAD + rows("P1", 3) + HEAD.replace("BASE", "TOOL") + rows("P1", 3), "export.txt:8: another frame begins"),
        (
            HEAD + rows("P1", 3)[:-30],
            "export.txt:6: has 5 cells where the others have 7; the last line seems to be cut",
        ),
        (HEAD + rows("P1", 3)[:-2], "export.txt:6: column 7 is no time"),
        (HEAD, "has no rows"),
        (HEAD.replace(" (mm)", "") + rows("P1", 3), "no unit of x"),
    ],
)
def test_odd_files_are_refused_with_their_line(tmp_path: Path, text: str, wanted: str) -> None:
    assert wanted in refused(tmp_path, text)


def test_times_of_several_groups_do_not_rise(tmp_path: Path) -> None:
    text = HEAD + rows("P2", 4, minute=53) + rows("P1", 4, minute=52)
    every = read(tmp_path, text, group="all")
    with pytest.raises(Exception, match=r"export.txt:8: time does not rise \(line 8\)"):
        track_of(every)
