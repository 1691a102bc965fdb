"""The cells of `make faults`, and what is made of the setpoints of one."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from compd.commissioning import BLIND_SPOTS
from tests.injection import run
from tests.injection.case import Way
from tests.injection.cells.cell import Cell, all_cells
from tests.injection.cells.report import report
from tests.injection.cells.situation import Situation
from tests.injection.cells.trial import CellResult
from tests.injection.machine import UNKNOWN, Held
from tests.injection.matrix import FAULTS, VIRTUAL
from tests.injection.run import Tried, all_names, sample
from tests.injection.trial import Outcome
from tests.injection.verdict import Verdict, judge, tip_bound_um
from tests.support.watching import Seen

CELLS = all_cells()


class KnownTruth:
    """The machine goes along x at 100 mm/s for a second, from 10 s on; nobody knows where it is after 12 s."""

    def rest_for(self, duration_s: float) -> None: ...

    def hold(self, seen: Sequence[Seen]) -> list[Held]:
        return [self._held(one["time_s"], one["tip_M_mm"]) for one in seen]

    def _held(self, time_s: float, tip_mm: Sequence[float]) -> Held:
        x_mm = 100 * min(max(time_s - 10.0, 0.0), 1.0)
        if time_s > 12.0:
            return UNKNOWN
        return Held(1e3 * math.dist(tip_mm, (x_mm, 2.0, 3.0)), not 10.0 < time_s < 11.0)


def judged(*seen: Seen) -> Verdict:
    machine: Any = KnownTruth()
    return judge(machine, seen)


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
    by_fault = {case.id: {c.situation for c in CELLS if c.cases == (case,)} for case in VIRTUAL}
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
    names = sample(all_names())
    part = [cell for cell in CELLS if cell.name in names]
    assert {cell.situation for cell in part} == set(Situation)
    assert {case.group for cell in part for case in cell.cases} == {case.group for case in VIRTUAL}
    assert any("@" not in name for name in names)
    assert {len(cell.cases) for cell in part} == {0, 1, 2}


def test_what_nothing_shows_is_a_blind_spot() -> None:
    assert {case.unseen for case in FAULTS if case.unseen} <= {spot.name for spot in BLIND_SPOTS}
    assert all(case.unseen for case in FAULTS if case.way is Way.UNSEEN)


# --- verdicts


def test_a_bound_is_a_number_or_the_norm_of_standard_uncertainties() -> None:
    assert tip_bound_um({"u_tip_um": 0.6}) == 0.6
    assert math.isnan(tip_bound_um({}))


def test_a_setpoint_is_held_against_the_tip_of_its_own_time() -> None:
    verdict = judged(setpoint(9.5, 0.0), setpoint(10.5034, 50.34 + 0.0004), setpoint(11.5, 100.0))
    assert verdict.held == 3
    assert verdict.worst_um == pytest.approx(0.4, abs=0.01)
    assert verdict.most == pytest.approx(0.4, abs=0.01)
    assert not verdict.problems


def test_a_setpoint_is_not_held_where_nobody_knows_the_tip() -> None:
    verdict = judged(setpoint(9.51, 0.0), setpoint(10.51, 51.0), setpoint(12.5, 0.0))
    assert (verdict.valid, verdict.held) == (3, 2)


@pytest.mark.parametrize(
    ("off_um", "count", "problem"),
    [(1.5, 6, "6 of 100 setpoints are valid and wrong"), (1.5, 5, ""), (2.1, 1, "wrong by 2.1 times its bound")],
)
def test_some_may_be_beyond_their_bound_and_none_beyond_twice(off_um: float, count: int, problem: str) -> None:
    wrong = [setpoint(9.1, off_um * 1e-3)] * count
    verdict = judged(*wrong, *[setpoint(9.2, 0.0)] * (100 - count))
    assert verdict.beyond == count
    assert problem in "; ".join(verdict.problems)
    assert bool(problem) is bool(verdict.problems)


def test_the_largest_error_at_rest_is_told_apart() -> None:
    verdict = judged(setpoint(9.5, 0.002), setpoint(10.5, 50.005), setpoint(11.5, 100.001))
    assert verdict.worst_um == pytest.approx(5.0)
    assert verdict.worst_at_rest_um == pytest.approx(2.0)
    assert verdict.worst["time_s"] == 9.5


def test_a_larger_bound_allows_a_larger_error() -> None:
    assert not judged(setpoint(9.1, 0.5, bound_um=600.0)).problems
    assert judged(setpoint(9.1, 0.5, bound_um=200.0)).problems


def test_a_valid_setpoint_without_a_bound_or_a_number_is_wrong() -> None:
    (problem,) = judged(setpoint(9.1, 1e-4, bound_um=None), setpoint(9.1, 1e-4)).problems
    assert problem == "1 of 2 valid setpoints have no bound; worst 0.1 um"
    assert judged(setpoint(9.1, math.nan)).worst_um == math.inf


def test_what_is_invalid_is_not_held() -> None:
    invalid = Seen(9.1, {"time_s": 9.1, "valid": False, "state": "stop", "reason": "why", "mode": "cmm"})
    verdict = judged(invalid, invalid)
    assert (verdict.setpoints, verdict.valid, verdict.states, verdict.reasons) == (2, 0, {"stop": 2}, ["why"])
    assert not verdict.problems


def test_old_targets_are_wrong_where_there_are_many_of_them() -> None:
    fresh = setpoint(9.2, 0.0, mode="machine_tool", target_id=9_100_000)
    old = setpoint(9.9, 0.0, mode="machine_tool", target_id=9_100_000)
    assert not judged(fresh).problems
    assert not judged(*[fresh] * 19, old).problems
    (problem,) = judged(*[fresh] * 18, old, old).problems
    assert problem == "2 of 20 setpoints answer an old target, up to 0.80 s"


# --- results


def result(cell: Cell, verdict: Verdict, way_out: str = "itself", broken: Sequence[str] = ()) -> CellResult:
    ids = [case.id for case in cell.cases]
    return CellResult(cell.name, ids, cell.situation.name.lower(), cell.unseen, verdict, way_out, [*broken])


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


def test_a_run_names_what_is_wrong_and_what_could_not_be_tried(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def tried(names: Sequence[str], jobs: int) -> list[Tried]:
        right = Verdict(setpoints=9, worst_um=0.2, most=0.3, bound_um=0.7)
        return [
            Tried(name, None if "load" in name else result(cell(name), right).as_data(), "the reason") for name in names
        ]

    monkeypatch.setattr(run, "_try", tried)
    assert run.main(["scale-jumps@*"]) == 1
    said = capsys.readouterr().out
    assert "could not be tried: scale-jumps@load\nthe reason" in said
    assert "4 trials, 1 not as they must be" in said
    assert run.main(["scale-jumps@r*", "--write", str(tmp_path / "faults.json")]) == 0
    assert len(json.loads((tmp_path / "faults.json").read_text())["cells"]) == 2


def test_a_trial_shows_the_same_each_time_and_its_failure_ends_no_other() -> None:
    first, again = run.try_named("scale-reply-lost"), run.try_named("scale-reply-lost")
    assert first == again
    assert first.result is not None
    assert not first.result["problems"]
    assert first.result["states"].keys() == {"ok"}
    failed = run.try_named("no-such-case")
    assert (failed.result, "StopIteration" in failed.why) == (None, True)


def test_the_report_names_what_is_wrong_and_what_nothing_shows() -> None:
    wrong = Verdict(setpoints=100, beyond=90, most=50.0, worst_um=7516.2, worst_bound_um=0.7)
    results = [result(cell(name), wrong).as_data() for name in ("scale-jumps@load", "scale-drifts@rest")]
    outcome = Outcome("joint-once", 0.25, 0.5, problems=["not ok"])
    text = report([outcome.as_data()], results)
    assert "WRONG joint-once                              0.25 um    50%        -        -\n    not ok" in text
    assert "busy computer       1      0      1       0" in text
    unseen, _, wrong_part = text.partition("what is wrong")
    assert "scale-drifts@rest" in unseen
    assert "scale-jumps@load" in wrong_part
    assert "7516.20 um        0.70 um\n    90 of 100 setpoints are valid" in wrong_part
