"""The cells of `make faults`, and what is made of the setpoints of one."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from queue import Queue
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compd.commissioning import BLIND_SPOTS
from tests.injection.case import Way
from tests.injection.cells import __main__ as run
from tests.injection.cells import workers
from tests.injection.cells.cell import Cell, all_cells, sample
from tests.injection.cells.report import report
from tests.injection.cells.situation import Situation
from tests.injection.cells.trial import CellResult
from tests.injection.cells.verdict import Verdict, judge, tip_bound_um
from tests.injection.cells.workers import Tried
from tests.injection.matrix import FAULTS
from tests.injection.truth import Asked, Truth
from tests.support.watching import Seen

CELLS = all_cells()


class KnownTruth(Truth):
    """The machine goes along x at 100 mm/s for a second, from 10 s on."""

    def __init__(self, every_s: float = 0.01) -> None:
        def asked(time_s: float) -> Asked:
            x_mm = 100 * min(max(time_s - 10.0, 0.0), 1.0)
            return Asked(time_s - 1e-3, time_s + 1e-3, np.array([x_mm, 2.0, 3.0]), 10.0 < time_s < 11.0, time_s)

        self._seen = [asked(9.0 + every_s * k) for k in range(round(3.0 / every_s) + 1)]

    def rest_for(self, duration_s: float) -> None: ...


def setpoint(time_s: float, x_mm: float, bound_um: Any = 1.0, **more: Any) -> Seen:
    stated = {} if bound_um is None else {"u_tip_um": bound_um}
    message = {
        "time_s": time_s,
        "valid": True,
        "state": "ok",
        "reason": "",
        "mode": "cmm",
        "tip_M_mm": [x_mm, 2.0, 3.0],
    }
    return Seen(time_s, message | stated | more)


# --- cells


def test_every_cell_has_a_name_of_its_own() -> None:
    assert len({cell.name for cell in CELLS}) == len(CELLS)


def test_every_fault_is_in_every_situation_that_fits_it() -> None:
    by_fault = {case.id: {c.situation for c in CELLS if c.cases == (case,)} for case in FAULTS}
    assert by_fault["scale-jumps"] == by_fault["thermometer-open"] == set(Situation)
    assert by_fault["scale-inch-at-zero"] == {Situation.MOTION}
    assert by_fault["loop-sigkill"] == set(Situation) - {Situation.RESTART}
    assert all(by_fault.values())
    assert {cell.situation for cell in CELLS if not cell.cases} == set(Situation)


def test_the_pairs_follow_from_the_seed_and_can_be_seen() -> None:
    pairs = [cell for cell in CELLS if len(cell.cases) == 2]
    assert len(pairs) == 150
    assert pairs == [cell for cell in all_cells() if len(cell.cases) == 2]
    assert pairs != [cell for cell in all_cells(seed=37) if len(cell.cases) == 2]
    assert not any(cell.unseen for cell in pairs)


def test_the_sample_has_something_of_every_kind() -> None:
    part = sample(CELLS)
    assert {cell.situation for cell in part} == set(Situation)
    assert {case.group for cell in part for case in cell.cases} == {case.group for case in FAULTS}
    assert {len(cell.cases) for cell in part} == {0, 1, 2}


def test_what_nothing_shows_is_a_blind_spot() -> None:
    assert {case.unseen for case in FAULTS if case.unseen} <= {spot.name for spot in BLIND_SPOTS}
    assert all(case.unseen for case in FAULTS if case.way is Way.UNSEEN)


# --- verdicts


def test_a_bound_is_a_number_or_the_norm_of_standard_uncertainties() -> None:
    assert tip_bound_um({"u_tip_um": 0.6}) == 0.6
    assert math.isnan(tip_bound_um({}))


def test_a_setpoint_is_held_against_the_tip_of_its_own_time() -> None:
    verdict = judge(KnownTruth(), [setpoint(9.5, 0.0), setpoint(10.5034, 50.34 + 0.0004), setpoint(11.5, 100.0)])
    assert verdict.held == 3
    assert verdict.worst_um == pytest.approx(0.4, abs=0.01)
    assert verdict.most == pytest.approx(0.4, abs=0.01)
    assert not verdict.problems


def test_a_setpoint_is_not_held_where_nobody_knows_the_tip() -> None:
    verdict = judge(KnownTruth(every_s=0.05), [setpoint(9.51, 0.0), setpoint(10.51, 0.0), setpoint(12.5, 0.0)])
    assert (verdict.valid, verdict.held) == (3, 1)


@pytest.mark.parametrize(
    ("off_um", "count", "problem"),
    [(1.5, 6, "6 of 100 setpoints are valid and wrong"), (1.5, 5, ""), (2.1, 1, "wrong by 2.1 times its bound")],
)
def test_some_may_be_beyond_their_bound_and_none_beyond_twice(off_um: float, count: int, problem: str) -> None:
    wrong = [setpoint(9.1, off_um * 1e-3)] * count
    verdict = judge(KnownTruth(), [*wrong, *[setpoint(9.2, 0.0)] * (100 - count)])
    assert verdict.beyond == count
    assert problem in "; ".join(verdict.problems)
    assert bool(problem) is bool(verdict.problems)


def test_a_larger_bound_allows_a_larger_error() -> None:
    assert not judge(KnownTruth(), [setpoint(9.1, 0.5, bound_um=600.0)]).problems
    assert judge(KnownTruth(), [setpoint(9.1, 0.5, bound_um=200.0)]).problems


def test_a_valid_setpoint_without_a_bound_or_a_number_is_wrong() -> None:
    (problem,) = judge(KnownTruth(), [setpoint(9.1, 1e-4, bound_um=None), setpoint(9.1, 1e-4)]).problems
    assert problem == "1 of 2 valid setpoints have no bound; worst 0.1 um"
    assert judge(KnownTruth(), [setpoint(9.1, math.nan)]).worst_um == math.inf


def test_what_is_invalid_is_not_held() -> None:
    invalid = Seen(9.1, {"time_s": 9.1, "valid": False, "state": "stop", "reason": "why", "mode": "cmm"})
    verdict = judge(KnownTruth(), [invalid, invalid])
    assert (verdict.setpoints, verdict.valid, verdict.states, verdict.reasons) == (2, 0, {"stop": 2}, ["why"])
    assert not verdict.problems


def test_old_targets_are_wrong_where_there_are_many_of_them() -> None:
    fresh = setpoint(9.2, 0.0, mode="machine_tool", target_id=9_100_000)
    old = setpoint(9.9, 0.0, mode="machine_tool", target_id=9_100_000)
    assert not judge(KnownTruth(), [fresh]).problems
    assert not judge(KnownTruth(), [*[fresh] * 19, old]).problems
    (problem,) = judge(KnownTruth(), [*[fresh] * 18, old, old]).problems
    assert problem == "2 of 20 setpoints answer an old target, up to 0.80 s"


# --- results


def result(cell: Cell, verdict: Verdict, way_out: str = "itself", broken: Sequence[str] = ()) -> CellResult:
    ids = [case.id for case in cell.cases]
    return CellResult(cell.name, ids, cell.situation.name.lower(), cell.unseen, verdict, way_out, 4.0, [*broken])


def cell(name: str) -> Cell:
    return next(cell for cell in CELLS if cell.name == name)


def test_a_fault_that_nothing_shows_may_be_wrong_and_must_be_left() -> None:
    wrong = Verdict(setpoints=100, beyond=90, most=50.0, worst_um=50.0)
    assert result(cell("scale-jumps@rest"), wrong).problems
    assert not result(cell("scale-drifts@rest"), wrong).problems
    assert result(cell("scale-drifts@rest"), wrong, way_out="restarted").problems
    assert result(cell("scale-drifts@rest"), wrong, broken=["no reason"]).problems


@pytest.mark.parametrize(("bound_um", "right"), [(0.29, False), (0.31, True), (0.59, True), (0.61, False)])
def test_without_a_fault_at_rest_the_bound_fits_the_error(bound_um: float, right: bool) -> None:
    verdict = Verdict(setpoints=100, held=90, bound_um=bound_um, error_95_um=0.3)
    assert bool(result(cell("no-fault@rest"), verdict).problems) is not right
    assert not result(cell("no-fault@load"), verdict).problems


@pytest.mark.parametrize(("held", "way_out"), [(0, "itself"), (90, "accepted")])
def test_without_a_fault_there_is_something_to_judge_and_nothing_to_accept(held: int, way_out: str) -> None:
    assert result(cell("no-fault@motion"), Verdict(setpoints=100, held=held), way_out=way_out).problems


# --- the run


@pytest.mark.parametrize(("tries", "wrong"), [("wrr", False), ("wwr", True), ("wrw", True), ("r", False)])
def test_of_a_cell_that_was_tried_again_most_tries_count(tmp_path: Path, tries: str, wrong: bool) -> None:
    one, out = cell("scale-jumps@rest"), tmp_path / "results.jsonl"
    lines = [{"cell": one.name, "problems": ["a problem"] if each == "w" else []} for each in tries]
    out.write_text("".join(json.dumps(line) + "\n" for line in lines))
    (found,) = run._results(out, [one])
    assert bool(found["problems"]) is wrong


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the cells that were tried; of the first run the second cannot be."""
    names: list[str] = []

    def side_by_side(cells: Sequence[Cell], jobs: int) -> Iterator[Tried]:
        for one in cells:
            names.append(one.name)
            failed = len(names) == 2
            verdict = Verdict(setpoints=9, worst_um=0.2, most=0.3, bound_um=0.7)
            yield Tried(one.name, None if failed else result(one, verdict).as_data(), "the reason" if failed else "")

    monkeypatch.setattr(run, "side_by_side", side_by_side)
    return names


def test_a_run_goes_on_where_it_stopped(
    tried: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out" / "faults.jsonl"
    asked = ["cells", "--out", str(out), "scale-jumps@*"]
    monkeypatch.setattr("sys.argv", asked)
    assert run.main() == 1
    assert "could not be tried: scale-jumps@motion\nthe reason" in capsys.readouterr().out
    assert [json.loads(line)["cell"] for line in out.read_text().splitlines()] == [tried[0], *tried[2:]]
    assert run.main() == 0
    assert tried[4:] == ["scale-jumps@motion"]
    assert "4 of 4 cells, 0 not as they must be" in capsys.readouterr().out
    monkeypatch.setattr("sys.argv", [*asked, "--fresh"])
    run.main()
    assert len(tried) == 9


def test_a_process_that_ends_leaves_its_cell_untried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "LOOK_EVERY_S", 0.0)
    done: Queue[Tried] = Queue()
    done.put(Tried("a@rest", {}))
    ended: Any = SimpleNamespace(is_alive=lambda: False)
    tried = list(workers._as_they_end(done, [ended], {"a@rest", "b@rest"}))  # type: ignore[arg-type]
    assert [(one.cell, one.result) for one in tried] == [("a@rest", {}), ("b@rest", None)]


def test_the_report_names_what_is_wrong_and_what_nothing_shows() -> None:
    wrong = Verdict(setpoints=100, beyond=90, most=50.0, worst_um=7516.2, worst_bound_um=0.7)
    results = [result(cell(name), wrong).as_data() for name in ("scale-jumps@load", "scale-drifts@rest")]
    text = report(results)
    assert "busy computer       1      0      1       0       4.0" in text
    unseen, _, wrong_part = text.partition("what is wrong")
    assert "scale-drifts@rest" in unseen
    assert "scale-jumps@load" in wrong_part
    assert "7516.20 um        0.70 um\n    90 of 100 setpoints are valid" in wrong_part
