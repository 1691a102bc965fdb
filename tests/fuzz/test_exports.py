"""Instruments' exports as text: read, or refused with the place."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compd.errors import RecordingError
from compd.instruments import ReadOptions, read_export
from tests.fuzz.bounds import examples, is_told, refusal
from tests.fuzz.mutations import changed_bytes

EXPORTS = [
    "// SpatialAnalyzer SA 2025.1 ( x64 )\n// Points Relative to Coordinate Frame 'A::WORLD'\n"
    "// AXES = CARTESIAN: X,  Y,  Z (mm)\nA,  P1,  0,  1.5,  2.5,  3.5,  02/12/25 16:52:45\n"
    "A,  P1,  1,  1.5,  2.5,  3.5,  02/12/25 16:52:45\nA,  P2,  2,  1.5,  2.5,  3.5,  02/12/25 16:52:46\n",
    "Zeit;X [mm];Y [mm];Z [mm]\n12.02.2025 16:56:08,125;1,5;2,5;3,5\n12.02.2025 16:56:08,25;1,5;2,5;3,5\n",
    "time\tx\ty\tz\ns\tmm\tmm\tmm\n2025-02-12T16:56:08.25Z\t1\t2\t3\n2025-02-12T16:56:08.50Z\t1\t2\t3\n",
    'Date,Time,Name,Group,X,Y,Z,rx,ry,rz\n"02/12/2025",04:56:08 PM,P1,A,1,2,3,0.1,0.2,0.3\n',
    "1 1.5 2.5 3.5\n2 1.5 2.5 3.5\n1 1.5 2.5 3.5\n",
    "# x y z\n1.5 2.5 3.5\n; c\n% c\n1.5 2.5 3.5",
]
ROLES = ["time", "date", "x", "y", "z", "rx", "length", "name", "group", "collection", "-", "x[inch]", "", "w"]
OPTIONS = st.builds(
    ReadOptions,
    shape=st.sampled_from([None, None, None, "sa", "csv", "blanks"]),
    columns=st.one_of(st.just(()), st.lists(st.sampled_from(ROLES), max_size=8).map(tuple)),
    names=st.dictionaries(
        st.sampled_from(["time", "x", "length"]), st.sampled_from(["Zeit", "1", "9" * 30, ""]), max_size=2
    ),
    unit=st.sampled_from([None, "mm", "inch", "deg", "\x00"]),
    angle_unit=st.sampled_from([None, "rad", "mm"]),
    decimal=st.sampled_from([None, ".", ","]),
    dates=st.sampled_from([None, "dmy", "mdy", "ymd"]),
    rate_hz=st.sampled_from([None, 10.0, 0.0]),
    group=st.sampled_from([None, "all", "P1", "A::P1"]),
)
CELLS = st.sampled_from(
    ["1", "-2.5", "3,125", "1.234,5", "1e5", "1e308", "x", "mm", "time", "", "12.02.25", "16:56:08", "0:00:00.1", "PM",
     "2025-02-12T16:56:08Z", "99/99/99", '"', "nan", "#", "//", "\u0661", "\xa0", "- -", "sep=;", "A b"]
)  # fmt: skip


@st.composite
def tables(draw: st.DrawFn) -> bytes:
    """Rows of odd cells between one delimiter."""
    delimiter = draw(st.sampled_from([",", ";", "\t", "|", " ", "  "]))
    count = draw(st.integers(1, 7))
    rows = st.lists(CELLS, min_size=count, max_size=count).map(delimiter.join)
    return "\n".join(draw(st.lists(rows, min_size=1, max_size=6))).encode()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("exports")


def told_or_read(path: Path, content: bytes, options: ReadOptions) -> bool:
    path.write_bytes(content)
    error = refusal(lambda: read_export(path, options), RecordingError)
    return is_told(error) and (error is None or all(str(path) in problem.where for problem in error.problems))


@pytest.mark.long
@pytest.mark.sample
@given(content=changed_bytes(EXPORTS), options=OPTIONS)
@examples(300)
def test_a_changed_export_is_one_or_is_refused(folder: Path, content: bytes, options: ReadOptions) -> None:
    assert told_or_read(folder / "export.txt", content, options)


@pytest.mark.long
@pytest.mark.sample
@given(content=st.binary(max_size=300).filter(lambda content: not content.startswith((b"PK\x03\x04", b"HEADER::"))))
@examples(200)
def test_bytes_are_an_export_or_are_refused(folder: Path, content: bytes) -> None:
    assert told_or_read(folder / "export.txt", content, ReadOptions())


@pytest.mark.long
@given(content=tables(), options=OPTIONS)
@examples(400)
def test_a_table_of_odd_cells_is_an_export_or_is_refused(folder: Path, content: bytes, options: ReadOptions) -> None:
    assert told_or_read(folder / "export.txt", content, options)
