"""The table while a run goes on."""

from __future__ import annotations

from pathlib import Path

from compd.fleet.checkpoint import WRITE_EVERY_S, Checkpoint
from compd.fleet.table import earlier_results
from tests.support.fleets import result


def test_the_table_is_written_now_and_then(tmp_path: Path) -> None:
    times_s = iter((0.0, 1.0, WRITE_EVERY_S, WRITE_EVERY_S + 1, 3 * WRITE_EVERY_S))
    path = tmp_path / "fleet.parquet"
    checkpoint = Checkpoint(path, times_s.__next__)
    seen = []
    for number in range(4):
        checkpoint.add(result("m1", number))
        seen.append(len(earlier_results(path)))
    assert seen == [0, 2, 2, 4]
    assert checkpoint.count == 4


def test_what_is_no_table_has_no_earlier_results(tmp_path: Path) -> None:
    (tmp_path / "run.parquet").write_text("PAR1")
    assert earlier_results(tmp_path / "run.parquet") == ()
    assert earlier_results(tmp_path / "nowhere.parquet") == ()
