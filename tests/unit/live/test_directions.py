"""Which way the links moved last: by every cycle, so that a recorder of a few Hz misses no reversal."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from compd.gauge import Quality
from compd.live.record.recorder import Recorder
from compd.live.system import THIS_COMPUTER
from tests.support.live_machine import machine
from tests.support.recorded_run import ROOMY, Run


@pytest.fixture
def run() -> Run:
    return Run(machine())


def driven(run: Run, *scale_mm: float) -> tuple[bytes, dict]:
    """Link 1 to these places, a cycle each; the last cycle's line and message."""
    for value in scale_mm:
        run.machine.change_mm["scale_1.position"] = value
        line, message, _ = run.recorded(run.machine.step())
    return line, message


def test_unknown_until_it_has_moved_and_creep_adds_up(run: Run) -> None:
    assert driven(run, 0.0, 0.0004, 0.0008)[1]["approach"] == [0, 0, 0]
    assert driven(run, 0.0012)[1]["approach"] == [1, 0, 0]


def test_turns_where_it_has_come_back_by_more_than_a_micrometre(run: Run) -> None:
    assert driven(run, 0.0, 5.0, 4.9995)[1]["approach"] == [1, 0, 0], "0.5 um back is standing still"
    assert driven(run, 4.998)[1]["approach"] == [-1, 0, 0]
    assert driven(run, 4.9985)[1]["approach"] == [-1, 0, 0]
    assert driven(run, 5.5)[1]["approach"] == [1, 0, 0]


def test_a_reading_that_is_not_good_is_no_motion(run: Run) -> None:
    driven(run, 0.0, 5.0)
    run.machine.faults = {"scale_1.position": Quality.TIMEOUT}
    assert driven(run, -100.0)[1]["approach"] == [1, 0, 0]


def test_a_thin_recording_has_the_way_that_was_not_recorded(run: Run, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run", run.version, run.watch, ROOMY, lambda text: None, THIS_COMPUTER)
    for cycles in ((0.0,), (5.0, 6.0), (5.5, 5.0)):  # every row at rest; between the last two it went out and came back
        recorder.put(*driven(run, *cycles))
    recorder.start()
    recorder.close()
    with (tmp_path / "run-0001.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["approach_1"] for row in rows] == ["", "1", "-1"]
    assert [row["approach_2"] for row in rows] == ["", "", ""]
    assert json.loads(driven(run, 5.0)[0])["approach"] == [-1, 0, 0]
