"""Plain CSV is the same table whoever parses its numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from compd.tables import ProblemList, Table, csv_table
from compd.tables.csv_table import parse_table

NAMES = ("time_s", "scale_1_mm", "humidity_pct")
NUMBERS = st.one_of(
    st.floats(allow_nan=False).map(repr).filter(lambda text: "inf" not in text),
    st.from_regex(r"[+-]?[0-9]{0,20}\.?[0-9]{0,20}(?:[eE][+-]?[0-9]{1,3})?", fullmatch=True),
    st.just(""),
)
LINES = st.lists(st.one_of(st.just(""), st.lists(NUMBERS, min_size=3, max_size=3).map(",".join)), max_size=8)


def parse(body: str, least_bytes_for_arrow: int) -> tuple[Table | None, ProblemList]:
    problems = ProblemList(Path("run.csv"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(csv_table, "_MIN_BYTES_FOR_ARROW", least_bytes_for_arrow)
        content = f"{','.join(NAMES)}\n{body}".encode()
        return parse_table(Path("run.csv"), content, problems, lambda names: names[0] == NAMES[0]), problems


@given(lines=LINES, line_end=st.sampled_from(["\n", "\r\n"]), last=st.booleans())
def test_arrow_and_python_read_the_same(lines: list[str], line_end: str, last: bool) -> None:
    body = line_end.join(lines) + line_end * last
    by_python, complaints = parse(body, 1 << 40)
    by_arrow, others = parse(body, 0)
    assert complaints.problems == others.problems
    assert by_python is not None
    assert by_arrow is not None
    np.testing.assert_array_equal(by_arrow.row, by_python.row)
    assert by_arrow.columns.keys() == by_python.columns.keys()
    for name, values in by_python.columns.items():
        assert by_arrow.columns[name].tobytes() == values.tobytes()


def test_names_in_quotes_make_no_table_slow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv_table, "read_cells", None)  # the way of all that is not plain
    header = ", ".join(f'"{name}"' for name in NAMES)
    table = parse_table(Path("run.csv"), f"{header}\n1,2,3\n".encode(), ProblemList(Path("run.csv")), lambda _: True)
    assert table is not None
    assert {name: values.tolist() for name, values in table.columns.items()} == dict(
        zip(NAMES, [[1], [2], [3]], strict=True)
    )
