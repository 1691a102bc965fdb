"""The table of a fleet: what was written is read again, by compd and by what people use."""

from __future__ import annotations

import re
from pathlib import Path

import duckdb
import pandas as pd
import pytest

from compd.errors import CompdError
from compd.fleet.recording_result import Command
from compd.fleet.table import COLUMNS, check_table_path, is_table, read_table, write_table
from tests.support.fleets import expansion, machine, result
from tests.support.paths import ROOT

PROBLEM = "lost.csv: cannot be read\n    next: copy it again"
RESULTS = (
    *machine("tripod-01", [1.1, 1.2]),
    result("tripod-02", 0),
    result("tripod-03", 0, [expansion(1.0, float("nan"), ("scale_expansion", "rod_expansion"))], started_at=None),
    result("", 1, problem=PROBLEM, verdict="", summary="", rows=0),
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "fleet.parquet"
    write_table(path, RESULTS)
    return path


def test_results_come_back_as_they_were(path: Path) -> None:
    # nan is not equal to itself
    assert list(map(repr, read_table(path))) == list(map(repr, RESULTS))


def test_pandas_reads_it(path: Path) -> None:
    table = pd.read_parquet(path)
    assert list(table.columns) == [column.name for column in COLUMNS]
    assert len(table) == len(RESULTS)
    means = table.groupby("machine")["value"].mean()
    assert means["tripod-01"] == pytest.approx(1.15)
    assert table["started_at"].dt.year.dropna().unique().tolist() == [2026]
    assert table.loc[table["machine"].isna(), "problem"].tolist() == [PROBLEM]


def test_duckdb_reads_it(path: Path) -> None:
    found = duckdb.sql(
        f"select machine, count(distinct recording), max(value) from '{path}' "
        "where effect = 'link_expansion' group by machine order by machine"
    ).fetchall()
    assert found == [("tripod-01", 2, 1.2), ("tripod-03", 1, 1.0)]
    empty = duckdb.sql(f"select count(*) from '{path}' where problem is null and effect is null").fetchall()
    assert empty == [(1,)]


def test_an_earlier_table_of_the_same_command_is_replaced_and_nothing_else(path: Path, tmp_path: Path) -> None:
    (command,) = {result.command for result in read_table(path)}
    check_table_path(path, command)
    other_command: Command = "diagnose" if command == "compare" else "compare"
    with pytest.raises(CompdError, match=f"has results of `compd fleet {command}`, which would be lost"):
        check_table_path(path, other_command)
    check_table_path(path, other_command, overwrite=True)
    other = tmp_path / "run.parquet"
    pd.DataFrame({"time_s": [0.0]}).to_parquet(other)
    assert not is_table(other)
    with pytest.raises(CompdError, match="is there already"):
        check_table_path(other, command)
    with pytest.raises(CompdError, match="does not exist"):
        check_table_path(tmp_path / "nowhere" / "fleet.parquet", command)


def test_the_guide_has_every_column() -> None:
    guide = (ROOT / "docs" / "how-to" / "watch-a-fleet.md").read_text(encoding="utf-8")
    rows = "".join(line.split("|")[1] for line in guide.splitlines() if line.startswith("| `"))
    assert re.findall(r"`(\w+)`", rows) == [column.name for column in COLUMNS]


def test_what_is_no_table_of_a_fleet_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run.parquet").write_text("PAR1")
    with pytest.raises(CompdError, match="is not a table of a fleet"):
        read_table(tmp_path / "run.parquet")
